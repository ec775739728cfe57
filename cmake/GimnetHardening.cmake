# For the folder that includes it, and those below: a mistake with memory, should there be one in what is shipped, ends the
# program instead of serving whoever found it. tests/system/hardening_test.py looks at the programs. The sanitizers see more,
# and bring runtimes of their own.
set(GIMNET_EVERY_FRAME_OPTIONS)
if(NOT GIMNET_SANITIZE)
  include(CheckPIESupported)
  check_pie_supported()
  add_compile_options(-fstack-protector-strong
    "$<$<CONFIG:RelWithDebInfo,Release,MinSizeRel>:-U_FORTIFY_SOURCE;-D_FORTIFY_SOURCE=2>")
  add_link_options(LINKER:-z,relro,-z,now,-z,noexecstack)
  # For what every frame passes: guards for functions with buffers of bytes. Those for all whose locals have an address took
  # up to 11 % more instructions a frame in the hub (./dev perf --instructions), and some 5 % in the libraries.
  set(GIMNET_EVERY_FRAME_OPTIONS -fstack-protector)
endif()
