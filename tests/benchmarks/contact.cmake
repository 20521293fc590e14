trocar_library(tests/benchmarks/contact
  SOURCES course.cpp output.cpp
  DEPENDS common_contact tests_benchmarks_partner
  PRIVATE_DEPENDS fmt::fmt host_report)
trocar_program(contact_benchmark SOURCES contact/contact_benchmark.cpp DEPENDS tests_benchmarks_contact fmt::fmt)
