# The real-time libraries in single precision: their own sources with the word double replaced by float, compiled into one library, float32.
# What follows by itself: types and limits by the word, Eigen's types and constants by their names, literals by -fsingle-precision-constant. What does not follow
# is named in the sources: common/core/precision.hpp. That nothing is left in double -Wdouble-promotion says, and on the Cortex-M7, where
# these files are compiled for a unit without double precision, the symbol table: no call of the compiler's double-precision arithmetic.
# Out: the image reader and writer, whose format holds float64, and hal's sources, of which the tick needs none.
set(generated ${CMAKE_BINARY_DIR}/float32)
set(sources "")
set(headers "")
foreach(folder IN LISTS realtime_folders)
  file(GLOB files RELATIVE ${CMAKE_SOURCE_DIR} CONFIGURE_DEPENDS
    ${CMAKE_SOURCE_DIR}/${folder}/*.hpp ${CMAKE_SOURCE_DIR}/${folder}/*/*.hpp ${CMAKE_SOURCE_DIR}/${folder}/*.cpp)
  list(FILTER files EXCLUDE REGEX "^(hal|common/model)/.*\\.cpp$")
  foreach(file IN LISTS files)
    add_custom_command(
      OUTPUT ${generated}/${file}
      COMMAND ${CMAKE_COMMAND} -E make_directory ${generated}/${folder}
      COMMAND sed -E "s/\\<double\\>/float/g; s/\\<(Vector|Matrix)([234X])d\\>/\\1\\2f/g; s/(std::numbers::[a-z0-9]+)\\>/\\1_v<float>/g" ${CMAKE_SOURCE_DIR}/${file} > ${generated}/${file}
      DEPENDS ${CMAKE_SOURCE_DIR}/${file}
      VERBATIM)
    if(file MATCHES "\\.cpp$")
      list(APPEND sources ${generated}/${file})
    else()
      list(APPEND headers ${generated}/${file})
    endif()
  endforeach()
endforeach()
add_custom_target(float32_headers DEPENDS ${headers})

add_library(float32_options INTERFACE)
target_include_directories(float32_options INTERFACE ${generated})
target_compile_definitions(float32_options INTERFACE TROCAR_FLOAT32)
# An integer becomes a float without a word: in double it would have fitted.
target_compile_options(float32_options INTERFACE -fsingle-precision-constant -Wno-conversion -Wfloat-conversion)
if(CMAKE_SYSTEM_NAME STREQUAL "Generic")
  target_compile_options(float32_options INTERFACE -mfpu=fpv5-sp-d16)
  target_link_options(float32_options INTERFACE -mfpu=fpv5-sp-d16)
endif()
add_library(float32 STATIC ${sources})
add_dependencies(float32 float32_headers)
target_link_libraries(float32 PRIVATE trocar_options trocar_realtime)
target_link_libraries(float32 PUBLIC float32_options Eigen3::Eigen)
