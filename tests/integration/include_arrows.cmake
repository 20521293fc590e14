# Tries what the build promises: with the real compile command of each folder, a header of a forbidden folder is not found.
# Needs SOURCE and BUILD (with compile_commands.json). Each rule: folders that match the first expression see no header that
# matches the second. Positive control: each folder does find its own headers.
cmake_minimum_required(VERSION 3.25)

set(rules
  "^common/ -> ^(hal|firmware|sim_plant|host)/"
  "^common/(core|mechanism|rig|element|model|contact|needle|insertion)$ -> ^common/(config|wire|capture|fem|scene|condense|image_file|experiment|optics)/"
  "^common/core$ -> ^common/(mechanism|rig)/"
  "^common/model$ -> ^common/(contact|insertion)/"
  "^common/image_file$ -> ^common/(fem|scene|condense)/"
  "^common/optics$ -> ^common/(fem|scene|condense|wire|capture)/"
  "^hal(/|$) -> ^(firmware|sim_plant|host|common/config|common/wire|common/capture|common/fem|common/scene|common/condense|common/image_file|common/experiment|common/optics)/"
  "^firmware/ -> ^(sim_plant|host)/"
  "^firmware/(control|safety|virtual_needle|controller)$ -> ^common/(config|wire|capture|fem|scene|condense|image_file|experiment|optics)/"
  "^sim_plant/ -> ^host/"
  "^sim_plant/(mechanism|nodes|phantom|plant)$ -> ^firmware/"
  "^host/ -> ^(hal|firmware|sim_plant)/")

# Folders without a source of their own are tried through a test that depends on them alone.
set(stand_in_common/core tests/unit/common/core/ring_test.cpp)

set(scratch ${BUILD}/include_arrows)
file(MAKE_DIRECTORY ${scratch})
file(GLOB_RECURSE headers RELATIVE ${SOURCE} ${SOURCE}/common/*.hpp ${SOURCE}/hal/*.hpp ${SOURCE}/firmware/*.hpp
     ${SOURCE}/sim_plant/*.hpp ${SOURCE}/host/*.hpp)

# One compile command for each folder: its first source.
file(READ ${BUILD}/compile_commands.json database)
string(JSON count LENGTH "${database}")
math(EXPR last "${count} - 1")
set(folders "")
foreach(i RANGE ${last})
  string(JSON file GET "${database}" ${i} file)
  cmake_path(RELATIVE_PATH file BASE_DIRECTORY ${SOURCE} OUTPUT_VARIABLE relative)
  if(NOT relative MATCHES "\\.cpp$" OR relative MATCHES "^\\.\\.")
    continue()
  endif()
  cmake_path(GET relative PARENT_PATH folder)
  if(relative STREQUAL "${stand_in_common/core}")
    set(folder common/core)
  elseif(folder MATCHES "^(tests|build)/")
    continue()
  endif()
  if(NOT folder IN_LIST folders)
    list(APPEND folders ${folder})
    string(JSON command_${folder} GET "${database}" ${i} command)
  endif()
endforeach()

# Preprocesses `text` as if it were a source of the folder.
function(preprocess folder text)
  string(MAKE_C_IDENTIFIER ${folder} name)
  file(WRITE ${scratch}/${name}.cpp "${text}")
  separate_arguments(arguments UNIX_COMMAND "${command_${folder}}")
  list(POP_FRONT arguments launcher)
  if(NOT launcher MATCHES "ccache$")
    list(PREPEND arguments ${launcher})
  endif()
  list(FIND arguments -o at)
  list(SUBLIST arguments 0 ${at} arguments)  # what follows is output and source
  execute_process(COMMAND ${arguments} -E -o ${scratch}/${name}.i ${scratch}/${name}.cpp
                  WORKING_DIRECTORY ${BUILD} RESULT_VARIABLE result ERROR_VARIABLE errors)
  set(result ${result} PARENT_SCOPE)
  set(errors "${errors}" PARENT_SCOPE)
endfunction()

set(tried 0)
set(refused 0)
set(failures "")
foreach(folder IN LISTS folders)
  set(own "")
  set(forbidden "")
  foreach(header IN LISTS headers)
    if(header MATCHES "^${folder}/")
      list(APPEND own ${header})
      continue()
    endif()
    foreach(rule IN LISTS rules)
      string(REGEX MATCH "^(.+) -> (.+)$" matched "${rule}")
      set(from "${CMAKE_MATCH_1}")
      set(to "${CMAKE_MATCH_2}")
      # A folder below one of the rule's (hal/can) follows its rule.
      if("${folder}" MATCHES "${from}" AND header MATCHES "${to}")
        list(APPEND forbidden ${header})
        break()
      endif()
    endforeach()
  endforeach()

  set(text "")
  foreach(header IN LISTS forbidden)
    string(APPEND text "#if __has_include(\"${header}\")\n#error reaches ${header}\n#endif\n")
  endforeach()
  foreach(header IN LISTS own)
    string(APPEND text "#if !__has_include(\"${header}\")\n#error misses its own ${header}\n#endif\n")
  endforeach()
  preprocess(${folder} "${text}")
  if(NOT result EQUAL 0)
    string(APPEND failures "${folder}:\n${errors}\n")
  endif()
  math(EXPR tried "${tried} + 1")

  # And as a person would notice it: the include itself stops the compiler, because there is no such file.
  if(forbidden)
    list(GET forbidden 0 header)
    preprocess(${folder} "#include \"${header}\"\n")
    if(result EQUAL 0 OR NOT errors MATCHES "${header}: No such file or directory")
      string(APPEND failures "${folder}: #include \"${header}\" did not end in \"No such file\":\n${errors}\n")
    endif()
    math(EXPR refused "${refused} + 1")
  endif()
endforeach()

if(failures)
  message(FATAL_ERROR "include arrows are broken:\n${failures}")
endif()
if(tried LESS 2 OR refused EQUAL 0)
  message(FATAL_ERROR "nothing was tried: ${tried} folders, ${refused} forbidden includes")
endif()
message(STATUS "${tried} folders tried")
