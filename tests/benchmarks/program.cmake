trocar_library(tests/benchmarks/program SOURCES program.cpp PRIVATE_DEPENDS fmt::fmt)
