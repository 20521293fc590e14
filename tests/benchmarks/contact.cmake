trocar_library(tests/benchmarks/contact
  SOURCES course.cpp output.cpp whole_step.cpp
  DEPENDS common_contact common_insertion common_image_file common_model tests_benchmarks_partner
  PRIVATE_DEPENDS tests_benchmarks_program fmt::fmt host_report common_condense common_scene)
trocar_program(contact_benchmark SOURCES contact/contact_benchmark.cpp DEPENDS tests_benchmarks_contact tests_benchmarks_program fmt::fmt)
