# Every source is as clang-format leaves it.
cmake_minimum_required(VERSION 3.25)

set(files "")
foreach(folder IN ITEMS common hal firmware sim_plant host tests)
  file(GLOB_RECURSE found ${SOURCE}/${folder}/*.hpp ${SOURCE}/${folder}/*.cpp)
  list(APPEND files ${found})
endforeach()
execute_process(COMMAND ${CLANG_FORMAT} --dry-run --Werror ${files} RESULT_VARIABLE result ERROR_VARIABLE errors)
if(NOT result EQUAL 0)
  string(REGEX MATCHALL "[^\n]*: error: [^\n]*" lines "${errors}")
  list(JOIN lines "\n" text)
  message(FATAL_ERROR "run clang-format -i on:\n${text}")
endif()
