trocar_library(tests/benchmarks/needle
  SOURCES elastica.cpp output.cpp thesis_figure.cpp
  DEPENDS common_needle tests_benchmarks_contact
  PRIVATE_DEPENDS tests_benchmarks_program common_fem fmt::fmt host_report)
trocar_program(needle_benchmark SOURCES needle/needle_benchmark.cpp
  DEPENDS tests_benchmarks_needle tests_benchmarks_contact tests_reference_grid_image common_insertion common_needle Eigen3::Eigen tests_benchmarks_program fmt::fmt)
# That it runs to its end and meets what does not depend on time; its times are for people.
add_test(NAME needle_benchmark_quick COMMAND needle_benchmark --quick --out ${CMAKE_CURRENT_BINARY_DIR}/needle_quick)
set_tests_properties(needle_benchmark_quick PROPERTIES LABELS benchmark TIMEOUT 120)
