trocar_library(tests/benchmarks/haptic
  SOURCES z_width.cpp feel.cpp output.cpp
  DEPENDS firmware_control common_mechanism tests_reference_haptic_axis
  PRIVATE_DEPENDS tests_benchmarks_program Eigen3::Eigen fmt::fmt host_report)
trocar_program(haptic_benchmark SOURCES haptic/haptic_benchmark.cpp DEPENDS tests_benchmarks_haptic firmware_control common_mechanism tests_reference_haptic_axis tests_benchmarks_program fmt::fmt)
# Nothing in it depends on time.
add_test(NAME haptic_benchmark_quick COMMAND haptic_benchmark --quick --out ${CMAKE_CURRENT_BINARY_DIR}/haptic_quick)
set_tests_properties(haptic_benchmark_quick PROPERTIES LABELS benchmark TIMEOUT 120)
