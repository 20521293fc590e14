# The symbol table of a linked image (NM, IMAGE): no allocator, no exception, nothing that waits. With EXPECT, an expression, the image must be
# refused and the refusal must match it: that the test can fail.
execute_process(COMMAND ${NM} --demangle ${IMAGE} RESULT_VARIABLE result OUTPUT_VARIABLE table ERROR_VARIABLE errors)
if(NOT result EQUAL 0)
  message(FATAL_ERROR "${NM} ${IMAGE}: ${errors}")
endif()
string(REGEX MATCHALL "[^\n]+" lines "${table}")
list(LENGTH lines count)
set(banned
  "_*(malloc|calloc|realloc|free|memalign)(_r)?|_?sbrk(_r)?"
  "operator (new|delete)[^\n]*"
  "__cxa_(throw|rethrow|allocate_exception|begin_catch|guard_acquire)|_Unwind_[A-Za-z]*|__gxx_personality[a-z0-9_]*|std::terminate\\(\\)"
  "_*(printf|sprintf|snprintf|vfprintf|fwrite|puts)(_r)?|sleep|usleep|nanosleep|abort")
list(JOIN banned "|" banned)
set(problems "")
foreach(line IN LISTS lines)
  if(line MATCHES " [A-Za-z] (${banned})$")
    string(APPEND problems "${CMAKE_MATCH_1}\n")
  endif()
endforeach()
if(EXPECT)
  if(NOT problems MATCHES "${EXPECT}")
    message(FATAL_ERROR "this image should have been refused for \"${EXPECT}\", but:\n${problems}")
  endif()
elseif(problems)
  message(FATAL_ERROR "the image has what allocates, throws or waits:\n${problems}")
elseif(count LESS 100)
  message(FATAL_ERROR "${count} symbols: this table proves nothing")
else()
  message(STATUS "${count} symbols")
endif()
