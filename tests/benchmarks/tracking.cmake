trocar_program(tracking_benchmark SOURCES tracking/tracking_benchmark.cpp
  DEPENDS host_tracking common_optics host_report tests_benchmarks_program trocar_opencv fmt::fmt)
# That it runs to its end, and that errors, which do not depend on time, meet their figures.
add_test(NAME tracking_benchmark_quick COMMAND tracking_benchmark --quick --out ${CMAKE_CURRENT_BINARY_DIR}/tracking_quick)
set_tests_properties(tracking_benchmark_quick PROPERTIES LABELS benchmark TIMEOUT 120)
