# Targets, warnings and include arrows. One target a folder; a folder's headers are visible only to targets that
# name it under DEPENDS, because each target exports a private include root that holds nothing but that folder:
#   build/…/include/common_core/common/core -> common/core      so  #include "common/core/ring.hpp"
# An include that DESIGN forbids therefore does not compile (tests/integration/include_arrows.cmake tries).

set(TROCAR_MARCH "" CACHE STRING "value for -march; empty leaves the compiler's default")
set(TROCAR_SANITIZE "" CACHE STRING "sanitizers, comma separated; empty for none")
set(TROCAR_FUZZ OFF CACHE BOOL "instrument for libFuzzer (clang only): tests/fuzz")
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)
set(CMAKE_ARCHIVE_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/lib)

find_program(TROCAR_CCACHE ccache)
if(TROCAR_CCACHE)
  set(CMAKE_C_COMPILER_LAUNCHER ${TROCAR_CCACHE})
  set(CMAKE_CXX_COMPILER_LAUNCHER ${TROCAR_CCACHE})
endif()

add_library(trocar_options INTERFACE)
target_compile_options(trocar_options INTERFACE
  $<$<COMPILE_LANGUAGE:CXX>:-Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wdouble-promotion -Wshadow -Werror>
  # Contraction into fused multiply-adds changes bits between inlined and outlined copies of one function.
  -ffp-contract=off)
if(TROCAR_MARCH)
  target_compile_options(trocar_options INTERFACE -march=${TROCAR_MARCH})
endif()
if(TROCAR_SANITIZE)
  target_compile_options(trocar_options INTERFACE -fsanitize=${TROCAR_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer)
  target_link_options(trocar_options INTERFACE -fsanitize=${TROCAR_SANITIZE})
endif()

if(TROCAR_FUZZ)
  target_compile_options(trocar_options INTERFACE -fsanitize=fuzzer-no-link)
endif()

# Real-time code: neither exceptions nor run-time type information exist there.
add_library(trocar_realtime INTERFACE)
target_compile_options(trocar_realtime INTERFACE $<$<COMPILE_LANGUAGE:CXX>:-fno-exceptions -fno-rtti>)

# trocar_library(FOLDER [REALTIME] [SOURCES …] [DEPENDS …] [PRIVATE_DEPENDS …])
# FOLDER is the path from the root; the target is FOLDER with '/' turned into '_'.
function(trocar_library folder)
  cmake_parse_arguments(ARG "REALTIME" "" "SOURCES;DEPENDS;PRIVATE_DEPENDS" ${ARGN})
  string(REPLACE "/" "_" target ${folder})
  set(root ${CMAKE_BINARY_DIR}/include/${target})
  get_filename_component(parent ${folder} DIRECTORY)
  file(MAKE_DIRECTORY ${root}/${parent})
  file(CREATE_LINK ${CMAKE_SOURCE_DIR}/${folder} ${root}/${folder} SYMBOLIC)
  if(ARG_SOURCES)
    list(TRANSFORM ARG_SOURCES PREPEND ${CMAKE_SOURCE_DIR}/${folder}/)
    add_library(${target} STATIC ${ARG_SOURCES})
    target_include_directories(${target} PUBLIC ${root})
    target_link_libraries(${target} PUBLIC ${ARG_DEPENDS} PRIVATE trocar_options ${ARG_PRIVATE_DEPENDS})
    if(ARG_REALTIME)
      set_property(GLOBAL APPEND PROPERTY TROCAR_REALTIME_LIBRARIES ${target})  # tests/integration/realtime_symbols.cmake
      target_link_libraries(${target} PRIVATE trocar_realtime)
    endif()
  else()
    add_library(${target} INTERFACE)
    target_include_directories(${target} INTERFACE ${root})
    target_link_libraries(${target} INTERFACE ${ARG_DEPENDS})
  endif()
endfunction()

# trocar_program(NAME SOURCES … DEPENDS …)
function(trocar_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPENDS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE trocar_options ${ARG_DEPENDS})
endfunction()

# trocar_test(NAME SOURCES … DEPENDS … [LABEL unit] [TIMEOUT seconds] [SERIAL])
# SERIAL: runs alone, because other load would starve the processes that it watches.
# Test sources live under tests/ and include only what their DEPENDS export.
function(trocar_test name)
  cmake_parse_arguments(ARG "SERIAL" "LABEL;TIMEOUT" "SOURCES;DEPENDS" ${ARGN})
  if(NOT ARG_LABEL)
    set(ARG_LABEL unit)
  endif()
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 60)
  endif()
  # For another processor some libraries are not built (tests/targets): the target stays, for whoever sets its properties, the test does not.
  foreach(library IN LISTS ARG_DEPENDS)
    if(CMAKE_CROSSCOMPILING AND NOT TARGET ${library})
      message(STATUS "${name} is left out: ${library} is not built for this processor")
      add_executable(${name} EXCLUDE_FROM_ALL ${ARG_SOURCES})
      return()
    endif()
  endforeach()
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE trocar_options ${ARG_DEPENDS} GTest::gtest GTest::gtest_main)
  gtest_discover_tests(${name} DISCOVERY_MODE PRE_TEST PROPERTIES LABELS ${ARG_LABEL} TIMEOUT ${ARG_TIMEOUT} RUN_SERIAL ${ARG_SERIAL})
endfunction()
