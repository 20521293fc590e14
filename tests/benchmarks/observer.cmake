trocar_library(tests/benchmarks/observer
  SOURCES course.cpp judge.cpp output.cpp times.cpp
  DEPENDS firmware_control common_core common_mechanism common_rig sim_plant_mechanism sim_plant_plant
  PRIVATE_DEPENDS sim_plant_bench sim_plant_hand sim_plant_wired firmware_controller tests_benchmarks_program tests_benchmarks_contact fmt::fmt host_report)
trocar_program(observer_benchmark SOURCES observer/observer_benchmark.cpp
  DEPENDS tests_benchmarks_observer common_config sim_plant_plant tests_benchmarks_program fmt::fmt)
target_compile_definitions(observer_benchmark PRIVATE TROCAR_SHARE="${CMAKE_SOURCE_DIR}/host/share")
# That it runs to its end and that the Nicosia observer meets its figures, which do not depend on time.
add_test(NAME observer_benchmark_quick COMMAND observer_benchmark --quick --out ${CMAKE_CURRENT_BINARY_DIR}/observer_quick)
set_tests_properties(observer_benchmark_quick PROPERTIES LABELS benchmark TIMEOUT 120)
