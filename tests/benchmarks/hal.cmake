trocar_program(bench_hal SOURCES hal_benchmark.cpp DEPENDS hal common_core common_rig sim_plant_nodes benchmark::benchmark benchmark::benchmark_main)
target_include_directories(bench_hal PRIVATE ${CMAKE_SOURCE_DIR}/tests/unit/hal)
