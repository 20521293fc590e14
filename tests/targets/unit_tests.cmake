# Unit tests for another processor with an operating system, under its emulator. What they need comes as sources or headers from this machine:
# GoogleTest, toml++. Those of the real-time libraries that compile in three minutes; the rest of these folders is left out with its libraries
# (trocar_test says so): what wants meshes, rig files, or an allocator in the place of its own. Of common/element the tick uses what the replay
# of mesh adaptation runs.
set(INSTALL_GTEST OFF)
set(BUILD_GMOCK OFF)
add_subdirectory(/usr/src/googletest/googletest ${CMAKE_BINARY_DIR}/googletest EXCLUDE_FROM_ALL)
target_compile_options(gtest PRIVATE -Wno-restrict)  # a false alarm of g++ 12, as a library from the distribution does not show it
include(GoogleTest)
find_package(Threads REQUIRED)
add_library(tomlplusplus::tomlplusplus INTERFACE IMPORTED GLOBAL)
trocar_library(tests/reference DEPENDS Eigen3::Eigen)

# What is tried is optimised as ever, what tries it need not be: half of its compile time.
add_compile_options(-O1)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/tests-bin)
foreach(folder IN ITEMS sim_plant/nodes tests/reference/haptic_axis
    tests/unit/common/core tests/unit/common/mechanism tests/unit/common/model tests/unit/common/contact tests/unit/common/needle
    tests/unit/hal tests/unit/firmware/control)
  add_subdirectory(${CMAKE_SOURCE_DIR}/${folder} ${CMAKE_BINARY_DIR}/${folder})
endforeach()
