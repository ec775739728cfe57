# One line per library, test, benchmark and fuzz target; each folder's CMakeLists.txt lists its sources.

# gimnet_library(NAME SOURCES a.cpp ... [DEPENDS lib ...] [IN_GROUPS]): a static library with the
# shared options. IN_GROUPS: some sources are compiled together, in a third of the time.
function(gimnet_library name)
  cmake_parse_arguments(ARG "IN_GROUPS" "" "SOURCES;DEPENDS" ${ARGN})
  add_library(${name} STATIC ${ARG_SOURCES})
  set_property(GLOBAL APPEND PROPERTY GIMNET_LIBRARIES ${name})
  if(ARG_IN_GROUPS)
    set_target_properties(${name} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 8)
  endif()
  target_link_libraries(${name} PUBLIC gimnet_options ${ARG_DEPENDS})
endfunction()

# gimnet_compile_as_test(TARGET): without optimisation, which takes two thirds of the time that tests
# take to compile, and with GoogleTest's headers read once. The libraries that it links keep theirs.
function(gimnet_compile_as_test target)
  if(NOT GIMNET_SANITIZE)
    target_compile_options(${target} PRIVATE -O0)
  endif()
  target_link_libraries(${target} PRIVATE GTest::gmock)
  get_target_property(_type ${target} TYPE)
  if(_type STREQUAL EXECUTABLE)
    target_precompile_headers(${target} REUSE_FROM gimnet_test_headers)
  endif()
endfunction()

# gimnet_test(FILE_test.cpp DEPENDS lib ...): a GoogleTest binary named after its path; every TEST is
# one ctest entry with the label "unit".
function(gimnet_test source)
  cmake_parse_arguments(ARG "" "" "DEPENDS" ${ARGN})
  file(RELATIVE_PATH _path ${PROJECT_SOURCE_DIR}/tests ${CMAKE_CURRENT_SOURCE_DIR}/${source})
  string(REGEX REPLACE "\\.(cpp|c)$" "" _name "${_path}")
  string(REPLACE "/" "." _name "${_name}")
  # TEST() registers by a global object; a source's options come after those that forbid these.
  set_source_files_properties(${source} PROPERTIES COMPILE_OPTIONS -Wno-global-constructors)
  add_executable(${_name} ${source})
  target_link_libraries(${_name} PRIVATE ${ARG_DEPENDS} GTest::gtest_main)
  gimnet_compile_as_test(${_name})
  target_include_directories(${_name} PRIVATE ${PROJECT_SOURCE_DIR})
  add_dependencies(all_unit ${_name})
  if(_name MATCHES "^hub\\.")
    add_dependencies(all_hub_unit ${_name})
  endif()
  gtest_discover_tests(${_name} DISCOVERY_TIMEOUT 60
    PROPERTIES TIMEOUT 120 LABELS unit ENVIRONMENT "XDG_RUNTIME_DIR=${GIMNET_TEST_RUNTIME}")
endfunction()

# gimnet_toy_stream_test(TEST [EXCEPT Subject.Behaviour ...]): a test once more, over streams that keep
# bytes of their own (tests/net/support/toy_stream.hpp).
function(gimnet_toy_stream_test name)
  cmake_parse_arguments(ARG "" "" "EXCEPT" ${ARGN})
  string(REPLACE ";" ":" _except "${ARG_EXCEPT}")
  add_test(NAME ${name}.over_toy_streams COMMAND ${name} --gtest_brief=1 --gtest_filter=-${_except})
  set_tests_properties(${name}.over_toy_streams PROPERTIES TIMEOUT 240 LABELS unit
    ENVIRONMENT "GIMNET_TEST_STREAM=toy;XDG_RUNTIME_DIR=${GIMNET_TEST_RUNTIME}")
endfunction()

# gimnet_bench(FILE_bench.cpp DEPENDS lib ...): a Google Benchmark binary; ctest runs it once, briefly, so that it cannot rot.
function(gimnet_bench source)
  cmake_parse_arguments(ARG "" "" "DEPENDS" ${ARGN})
  file(RELATIVE_PATH _path ${PROJECT_SOURCE_DIR} ${CMAKE_CURRENT_SOURCE_DIR}/${source})
  string(REGEX REPLACE "\\.cpp$" "" _name "${_path}")
  string(REPLACE "/" "." _name "${_name}")
  add_executable(${_name} ${source})
  target_link_libraries(${_name} PRIVATE ${ARG_DEPENDS} benchmark::benchmark benchmark::benchmark_main)
  if(GIMNET_TESTS)
    add_test(NAME ${_name}.smoke COMMAND ${_name} --benchmark_min_time=0.001)
  endif()
endfunction()

# gimnet_fuzz(FILE_fuzz.cpp DEPENDS lib ...): a libFuzzer target FILE_fuzz; seeds, if it has any, in
# fuzz/seeds/FILE_fuzz; ctest runs it for a second. See fuzz/README.md.
function(gimnet_fuzz source)
  cmake_parse_arguments(ARG "" "" "DEPENDS" ${ARGN})
  get_filename_component(_name ${source} NAME_WE)
  add_executable(${_name} ${source})
  target_link_libraries(${_name} PRIVATE ${ARG_DEPENDS})
  target_include_directories(${_name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_compile_options(${_name} PRIVATE -fsanitize=fuzzer)
  target_link_options(${_name} PRIVATE -fsanitize=fuzzer)
  add_dependencies(all_fuzz ${_name})
  set(_inputs ${PROJECT_BINARY_DIR}/corpus/${_name})
  file(MAKE_DIRECTORY ${_inputs} ${PROJECT_BINARY_DIR}/crashes)
  if(IS_DIRECTORY ${PROJECT_SOURCE_DIR}/fuzz/seeds/${_name})
    list(APPEND _inputs ${PROJECT_SOURCE_DIR}/fuzz/seeds/${_name})
  endif()
  set(_options -max_total_time=1 -timeout=10 -rss_limit_mb=1024
    -artifact_prefix=${PROJECT_BINARY_DIR}/crashes/${_name}-)
  if(EXISTS ${PROJECT_SOURCE_DIR}/fuzz/gimnet.dict)
    list(APPEND _options -dict=${PROJECT_SOURCE_DIR}/fuzz/gimnet.dict)
  endif()
  add_test(NAME fuzz.${_name} COMMAND ${_name} ${_options} ${_inputs})
  set_tests_properties(fuzz.${_name} PROPERTIES LABELS fuzz TIMEOUT 120)
endfunction()

# gimnet_group(NAME FOLDER): a target NAME that builds the programs of a folder and nothing else.
function(gimnet_group name folder)
  get_property(_targets DIRECTORY ${folder} PROPERTY BUILDSYSTEM_TARGETS)
  get_property(_below DIRECTORY ${folder} PROPERTY SUBDIRECTORIES)
  foreach(_subfolder ${_below})
    get_property(_more DIRECTORY ${_subfolder} PROPERTY BUILDSYSTEM_TARGETS)
    list(APPEND _targets ${_more})
  endforeach()
  add_custom_target(${name} DEPENDS ${_targets})
endfunction()

if(GIMNET_TESTS)
  include(GoogleTest)
  find_package(GTest REQUIRED)
  add_custom_target(all_unit)
  add_custom_target(all_hub_unit)
  # Holds the precompiled headers of all tests; a program, since those of a library differ (-fPIC).
  file(WRITE ${PROJECT_BINARY_DIR}/test_headers.cpp "int main() { return 0; }\n")
  add_executable(gimnet_test_headers ${PROJECT_BINARY_DIR}/test_headers.cpp)
  target_link_libraries(gimnet_test_headers PRIVATE gimnet_options GTest::gmock)
  target_precompile_headers(gimnet_test_headers PRIVATE
    $<$<COMPILE_LANGUAGE:CXX>:<gmock/gmock.h$<ANGLE-R>> $<$<COMPILE_LANGUAGE:CXX>:<gtest/gtest.h$<ANGLE-R>>)
  if(NOT GIMNET_SANITIZE)
    target_compile_options(gimnet_test_headers PRIVATE -O0)
  endif()
  # What nodes and hubs leave for their next life belongs to the tests, not to the user who runs them.
  set(GIMNET_TEST_RUNTIME ${PROJECT_BINARY_DIR}/run)
  file(MAKE_DIRECTORY ${GIMNET_TEST_RUNTIME})
endif()
