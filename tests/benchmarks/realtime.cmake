trocar_library(tests/benchmarks/realtime
  SOURCES course.cpp paced.cpp cyclictest.cpp output.cpp
  DEPENDS common_model common_rig common_scene firmware_controller firmware_control firmware_safety firmware_virtual_needle hal sim_plant_hand
    sim_plant_plant
  PRIVATE_DEPENDS tests_benchmarks_program common_condense common_config fmt::fmt host_report)
target_compile_definitions(tests_benchmarks_realtime PRIVATE TROCAR_SHARE="${CMAKE_SOURCE_DIR}/host/share"
  TROCAR_REALTIME_SCENE="${CMAKE_CURRENT_SOURCE_DIR}/realtime/scene.toml")
foreach(program IN ITEMS realtime_benchmark instructions_benchmark)
  trocar_program(${program} SOURCES realtime/${program}.cpp
    DEPENDS tests_benchmarks_realtime tests_benchmarks_program common_image_file fmt::fmt host_report)
endforeach()
# That it runs to its end with the contacts that it promises, and that a tick does the same in every execution; no time is judged.
add_test(NAME realtime_benchmark_quick COMMAND realtime_benchmark --quick --out ${CMAKE_CURRENT_BINARY_DIR}/realtime_quick)
set_tests_properties(realtime_benchmark_quick PROPERTIES LABELS benchmark TIMEOUT 120)
