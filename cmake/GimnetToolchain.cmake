# Warnings, sanitizers and build accelerators that every target shares.

option(GIMNET_WARNINGS_AS_ERRORS "Stop at the first warning: on in this project's own presets" OFF)
option(GIMNET_CCACHE "Compile through ccache" "$ENV{GIMNET_CCACHE}")
option(GIMNET_LLD "Link with lld" "$ENV{GIMNET_LLD}")

add_library(gimnet_options INTERFACE)
target_compile_features(gimnet_options INTERFACE cxx_std_20)  # of the headers, for other projects
target_compile_options(gimnet_options INTERFACE
  -Wall -Wextra -Wshadow -Wconversion $<$<BOOL:${GIMNET_WARNINGS_AS_ERRORS}>:-Werror>
  $<$<COMPILE_LANGUAGE:CXX>:-Wnon-virtual-dtor -Woverloaded-virtual>
  $<$<AND:$<CXX_COMPILER_ID:Clang>,$<COMPILE_LANGUAGE:CXX>>:-Wthread-safety -Wglobal-constructors
    -Wno-unused-command-line-argument>)
target_include_directories(gimnet_options INTERFACE ${PROJECT_SOURCE_DIR}/src ${PROJECT_SOURCE_DIR}/include)

if(GIMNET_SANITIZE STREQUAL "address")
  target_compile_options(gimnet_options INTERFACE
    -fsanitize=address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer
    # Looks at memory by way of a pipe: without a free descriptor every object would be an invalid one, and the test
    # that counts system calls would count these too.
    $<$<COMPILE_LANGUAGE:CXX>:-fno-sanitize=vptr>)
  target_link_options(gimnet_options INTERFACE -fsanitize=address,undefined)
elseif(GIMNET_SANITIZE STREQUAL "thread")
  # ThreadSanitizer does not model the fences inside concurrentqueue; the alias in
  # hub/concurrent puts a mutex queue in its place.
  target_compile_options(gimnet_options INTERFACE -fsanitize=thread -fno-omit-frame-pointer)
  target_compile_definitions(gimnet_options INTERFACE GIMNET_TSAN_QUEUE=1)
  target_link_options(gimnet_options INTERFACE -fsanitize=thread)
elseif(GIMNET_SANITIZE)
  message(FATAL_ERROR "GIMNET_SANITIZE is '${GIMNET_SANITIZE}': use address, thread, or leave it empty")
endif()

if(GIMNET_FUZZ)
  # The fuzzer steers by the branches that an input takes in the libraries, not only in its target.
  target_compile_options(gimnet_options INTERFACE -fsanitize=fuzzer-no-link)
endif()

# gimnet_need_program(OPTION PROGRAM PACKAGE): ends here where the program of an option is missing,
# and not in the middle of the build.
function(gimnet_need_program option program package)
  find_program(_found ${program} NO_CACHE)
  if(NOT _found)
    message(FATAL_ERROR "${option} is on, and ${program} is not installed: install it with "
      "`apt-get install ${package}`, or configure with -D ${option}=OFF")
  endif()
endfunction()

if(GIMNET_CCACHE)
  gimnet_need_program(GIMNET_CCACHE ccache ccache)
  set(CMAKE_C_COMPILER_LAUNCHER ccache)
  set(CMAKE_CXX_COMPILER_LAUNCHER ccache)
endif()
if(GIMNET_LLD)
  gimnet_need_program(GIMNET_LLD ld.lld lld)
  add_link_options(-fuse-ld=lld)
endif()

if(CMAKE_CXX_CLANG_TIDY)
  # What clang-tidy has passed is not looked at again before it, or a header of it, changes; nor before the rules do.
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/.clang-tidy)
  file(SHA256 ${PROJECT_SOURCE_DIR}/.clang-tidy _rules)
  add_compile_definitions(GIMNET_LINT_RULES=${_rules})
endif()
