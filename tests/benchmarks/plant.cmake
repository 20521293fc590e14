add_executable(plant_benchmark plant_benchmark.cpp)
target_link_libraries(plant_benchmark PRIVATE trocar_options sim_plant_plant benchmark::benchmark benchmark::benchmark_main)
target_compile_definitions(plant_benchmark PRIVATE TROCAR_SHARE="${CMAKE_SOURCE_DIR}/host/share")
