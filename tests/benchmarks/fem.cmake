add_executable(fem_benchmark fem_benchmark.cpp)
target_link_libraries(fem_benchmark PRIVATE trocar_options common_fem benchmark::benchmark benchmark::benchmark_main)
