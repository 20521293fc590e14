# What the real-time libraries call from outside of themselves, by the symbol tables of their archives: no allocator, no exception, no lock
# and nothing that waits. Everything that is not arithmetic or a copy in memory has to be named below with its reason.
# On Arm the compiler calls its runtime for 64-bit integers and their conversions, by names of the ABI; not for arithmetic in double.
# Needs NM and ARCHIVES, LIBRARY=FILE separated by '|'. With EXPECT, an expression, they must be refused and the refusal must match it: that the
# test can fail.
cmake_minimum_required(VERSION 3.25)

# The C library's arithmetic and memory; what the compiler calls by itself (the first line); Debian's libm under its finite names.
set(plain
  "_GLOBAL_OFFSET_TABLE_|__stack_chk_fail|__assert_fail"
  "__aeabi_(u?ldivmod|u?l2[df]|[df]2u?lz)"
  "mem(cpy|move|set|cmp)|strlen|bcmp"
  "(sin|cos|tan|sincos|asin|acos|atan|atan2|sinh|cosh|tanh|exp|exp2|expm1|log|log2|log10|log1p|pow|sqrt|cbrt|hypot|fmod|remainder|floor|ceil|round|lround|llround|rint|trunc|nearbyint|fma|ldexp|frexp|scalbn|copysign|nextafter)f?")
list(JOIN plain "|" plain)

# LIBRARY/OBJECT: symbols: reason. hal is where the operating system begins; its files for that are named one by one.
set(allowed
  "hal/clock.cpp: clock_gettime|clock_nanosleep|ppoll: the wait for the next tick, or for an answer until a deadline, is what it is for"
  "hal/counters.cpp: getrusage: reads counters of the kernel, without waiting, not in every tick"
  "hal/setup.cpp: mlockall|sched_(getaffinity|setaffinity|setscheduler)|__sched_cpucount|prctl|open|read|write|close|snprintf|strerror|__errno_location: before the first tick"
  "hal/socketcan_bus.cpp: socket|bind|setsockopt|ioctl|close|snprintf|strerror|__errno_location: opening, before the first tick"
  "hal/socketcan_bus.cpp: recvmmsg|write|clock_gettime: the tick's own traffic, on a socket that never waits"
  "hal/udp_bus.cpp: socket|bind|connect|getaddrinfo|freeaddrinfo|close|snprintf|strerror|__errno_location: opening, before the first tick"
  "hal/udp_bus.cpp: recv|send: the tick's own traffic, on a socket that never waits"
  "hal/master.cpp: snprintf: a line for people, on request"
  "hal/candump.cpp: snprintf: a line of a log, on request"
  "firmware_virtual_needle/virtual_needle.cpp: operator new\\(unsigned (long|int), std::align_val_t\\)|operator delete\\(.*\\): in its constructor"
  "float32/virtual_needle.cpp: operator new\\(unsigned (long|int), std::align_val_t\\)|operator delete\\(.*\\): in its constructor")

set(problems "")
set(symbols_seen 0)
string(REPLACE "|" ";" archives "${ARCHIVES}")
foreach(pair IN LISTS archives)
  string(REGEX MATCH "^([^=]+)=(.+)$" matched "${pair}")
  set(library "${CMAKE_MATCH_1}")
  set(archive "${CMAKE_MATCH_2}")
  execute_process(COMMAND ${NM} --undefined-only --demangle ${archive} RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE errors)
  if(NOT result EQUAL 0)
    message(FATAL_ERROR "${NM} ${archive}: ${errors}")
  endif()
  string(REPLACE ";" "," output "${output}")
  string(REPLACE "[" "(" output "${output}")
  string(REPLACE "]" ")" output "${output}")
  string(REPLACE "\n" ";" lines "${output}")
  set(object "")
  foreach(line IN LISTS lines)
    if(line MATCHES "^([^ ].*)\\.o(bj)?:$")
      set(object "${CMAKE_MATCH_1}")
      continue()
    endif()
    if(NOT line MATCHES "^ +[UwvWV] (.+)$")
      continue()
    endif()
    set(symbol "${CMAKE_MATCH_1}")
    math(EXPR symbols_seen "${symbols_seen} + 1")
    # Another function of the project: of a real-time library too, or it would not link (include_arrows).
    if(symbol MATCHES "(^| )trocar::" OR symbol MATCHES "^(${plain})$")
      continue()
    endif()
    set(named FALSE)
    foreach(entry IN LISTS allowed)
      string(REGEX MATCH "^([^:]+): (.+): [^:]+$" matched "${entry}")
      if("${library}/${object}" STREQUAL "${CMAKE_MATCH_1}" AND symbol MATCHES "^(${CMAKE_MATCH_2})$")
        set(named TRUE)
        break()
      endif()
    endforeach()
    if(NOT named)
      string(APPEND problems "${library}: ${object} calls ${symbol}\n")
    endif()
  endforeach()
endforeach()

if(EXPECT)
  if(NOT problems MATCHES "${EXPECT}")
    message(FATAL_ERROR "this archive should have been refused for \"${EXPECT}\", but:\n${problems}")
  endif()
  return()
endif()
if(problems)
  message(FATAL_ERROR "real-time libraries call what may allocate, throw or wait:\n${problems}")
endif()
if(symbols_seen EQUAL 0)
  message(FATAL_ERROR "the archives call nothing at all: this test proves nothing")
endif()
message(STATUS "${symbols_seen} symbols")
