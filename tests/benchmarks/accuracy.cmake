trocar_library(tests/benchmarks/accuracy
  SOURCES block.cpp fine_reference.cpp course.cpp method.cpp output.cpp solid.cpp
  DEPENDS common_condense common_fem common_insertion common_model common_scene tests_reference
  PRIVATE_DEPENDS tests_benchmarks_program fmt::fmt host_report)
trocar_program(accuracy_benchmark SOURCES accuracy_benchmark.cpp DEPENDS tests_benchmarks_accuracy tests_benchmarks_program fmt::fmt)
# That it runs to its end and finds the force continuous; its figures are for people.
add_test(NAME accuracy_benchmark_quick COMMAND accuracy_benchmark --quick --out ${CMAKE_CURRENT_BINARY_DIR}/accuracy_quick)
set_tests_properties(accuracy_benchmark_quick PROPERTIES LABELS benchmark TIMEOUT 300)
