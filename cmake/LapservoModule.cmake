# One folder of lapservo/, or one room in it, is one target. lapservo_module(NAME SOURCES ... USES ... TESTS ...) declares what
# the folder compiles, the only targets it may include (USES, passed on to its users), what it needs privately (PRIVATE: not in
# public headers), its tests, which stand beside the sources (LONG_TESTS: those with something that is too slow under sanitizers),
# and the headers that are installed (PUBLIC_HEADERS); all other headers are internal. The linker and the test `boundaries`
# (LapservoBoundaries.cmake) enforce the direction of dependencies.
# What has no public header and is no room is nobody's library: it goes into the tool. All libraries are static;
# LapservoShared.cmake makes one shared library of the others. GLUE: lapservo_compile_glue().
function(lapservo_module name)
  cmake_parse_arguments(M "GLUE" "" "PUBLIC_HEADERS;SOURCES;USES;PRIVATE;TESTS;LONG_TESTS;TEST_USES" ${ARGN})
  set(target lapservo_${name})
  set(scope PUBLIC)
  if(NOT M_SOURCES)
    add_library(${target} INTERFACE)
    set(scope INTERFACE)
  else()
    add_library(${target} STATIC ${M_SOURCES})
  endif()
  add_library(lapservo::${name} ALIAS ${target})
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name})
  target_compile_features(${target} ${scope} cxx_std_20)
  target_include_directories(${target} ${scope}
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_link_libraries(${target} ${scope} ${M_USES})
  if(M_SOURCES)
    target_link_libraries(${target} PRIVATE ${M_PRIVATE} $<BUILD_INTERFACE:lapservo_flags>)
  endif()
  if(M_GLUE)
    lapservo_compile_glue(${target})
  elseif(M_SOURCES)
    lapservo_precompile(${target})
  endif()
  cmake_path(RELATIVE_PATH CMAKE_CURRENT_SOURCE_DIR BASE_DIRECTORY ${PROJECT_SOURCE_DIR}/lapservo OUTPUT_VARIABLE folder)
  if(M_PUBLIC_HEADERS OR folder MATCHES "/")
    lapservo_install(${target} ${M_PUBLIC_HEADERS})
    set_property(GLOBAL APPEND PROPERTY LAPSERVO_PUBLIC_MODULES ${name})
  endif()
  if(M_PUBLIC_HEADERS)
    set_property(GLOBAL APPEND PROPERTY LAPSERVO_COMPONENTS ${name})
  endif()
  lapservo_remember_module(${name} ${folder} ${ARGN})
  set(tests ${M_LONG_TESTS})
  if(LAPSERVO_SHORT_TESTS)
    list(APPEND tests ${M_TESTS})
  endif()
  if(LAPSERVO_BUILD_TESTS AND tests)
    add_executable(${name}_test ${tests})
    target_link_libraries(${name}_test PRIVATE lapservo::${name} ${M_TEST_USES} lapservo_testing lapservo_flags GTest::gtest_main)
    lapservo_compile_test(${name}_test)
    lapservo_link_optimised_first(${name}_test)
    lapservo_module_tests(${name})
  endif()
endfunction()

# A target that others may link, with the headers that they may include.
function(lapservo_install target)
  get_target_property(type ${target} TYPE)
  set(scope PUBLIC)
  if(type STREQUAL INTERFACE_LIBRARY)
    set(scope INTERFACE)
  endif()
  target_sources(${target} ${scope} FILE_SET HEADERS BASE_DIRS ${PROJECT_SOURCE_DIR} FILES ${ARGN})
  install(TARGETS ${target} EXPORT lapservoTargets FILE_SET HEADERS)
endfunction()

# What stands between lapservo/ and the world outside: lapservo_adapter(NAME SOURCES ... USES ... PRIVATE ...) is nobody's
# library either.
function(lapservo_adapter name)
  cmake_parse_arguments(A "" "" "SOURCES;USES;PRIVATE" ${ARGN})
  set(target lapservo_${name})
  add_library(${target} STATIC ${A_SOURCES})
  add_library(lapservo::${name} ALIAS ${target})
  target_include_directories(${target} PUBLIC ${PROJECT_SOURCE_DIR})
  target_link_libraries(${target} PUBLIC ${A_USES} PRIVATE ${A_PRIVATE} lapservo_flags)
  lapservo_precompile(${target})
endfunction()

# The headers that most files include are compiled once for libraries and the tool (lapservo_precompiled) and once, with
# GoogleTest's, for tests (lapservo_test_precompiled). Without LAPSERVO_PRECOMPILE_HEADERS each file includes them itself;
# `./dev lint` checks that each file can.
function(lapservo_precompile target)
  if(LAPSERVO_PRECOMPILE_HEADERS)
    target_precompile_headers(${target} REUSE_FROM lapservo_precompiled)
  endif()
endfunction()

# For tests. Clang's sanitizers cost most of their compile time in the optimiser, so the sanitized tests are not optimised.
function(lapservo_compile_test target)
  if(LAPSERVO_SANITIZE)
    target_compile_options(${target} PRIVATE -O0)
    set_target_properties(${target} PROPERTIES LAPSERVO_UNOPTIMISED ON)
  endif()
  if(LAPSERVO_PRECOMPILE_HEADERS)
    target_precompile_headers(${target} REUSE_FROM lapservo_test_precompiled)
  endif()
endfunction()

# For code that computes little itself: optimised as the libraries are, but where sanitized compiled as the tests are.
function(lapservo_compile_glue target)
  if(LAPSERVO_SANITIZE)
    lapservo_compile_test(${target})
  else()
    lapservo_precompile(${target})
  endif()
endfunction()

# For sanitized tests. Of an inline function that several objects have, as of Eigen's, the linker takes the first one's for all
# of them, and a program's own objects, which are not optimised, would come first.
function(lapservo_link_optimised_first target)
  if(LAPSERVO_SANITIZE)  # when all libraries are there
    cmake_language(EVAL CODE "cmake_language(DEFER DIRECTORY [[${PROJECT_SOURCE_DIR}]] CALL lapservo_put_optimised_first ${target})")
  endif()
endfunction()
function(lapservo_put_optimised_first target)
  lapservo_libraries_of(${target} libraries)
  set(archives)
  foreach(library IN LISTS libraries)
    get_target_property(type ${library} TYPE)
    get_target_property(unoptimised ${library} LAPSERVO_UNOPTIMISED)
    if(type STREQUAL STATIC_LIBRARY AND NOT unoptimised)
      string(APPEND archives ",$<TARGET_FILE:${library}>")
    endif()
  endforeach()
  if(archives)
    target_link_options(${target} PRIVATE "LINKER:--whole-archive${archives},--no-whole-archive")
  endif()
endfunction()

# Our own libraries that a target needs, however many others are between.
function(lapservo_libraries_of target result)
  set(found)
  set(ahead ${target})
  while(ahead)
    list(POP_FRONT ahead next)
    if(NOT TARGET ${next})
      continue()
    endif()
    get_target_property(aliased ${next} ALIASED_TARGET)
    if(aliased)
      set(next ${aliased})
    endif()
    if(NOT next MATCHES "^lapservo_|^${target}$" OR next IN_LIST found)
      continue()
    endif()
    list(APPEND found ${next})
    foreach(property LINK_LIBRARIES INTERFACE_LINK_LIBRARIES)
      get_target_property(uses ${next} ${property})
      if(uses)
        list(APPEND ahead ${uses})
      endif()
    endforeach()
  endwhile()
  list(REMOVE_ITEM found ${target})
  set(${result} ${found} PARENT_SCOPE)
endfunction()

# Of a folder's tests, those that compute much themselves: where sanitized, too slow without optimisation.
function(lapservo_optimise)
  if(LAPSERVO_SANITIZE)
    set_source_files_properties(${ARGN} PROPERTIES COMPILE_OPTIONS -O1 SKIP_PRECOMPILE_HEADERS ON)
  endif()
endfunction()

# -Wno-restrict, -Wno-array-bounds: GCC 12 reports them falsely inside std::string (GCC bug 105651).
# Warnings and sanitizers for our own code only; never part of what users of the package inherit.
add_library(lapservo_flags INTERFACE)
target_compile_options(lapservo_flags INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor
  $<$<CXX_COMPILER_ID:GNU>:-Wduplicated-cond -Wlogical-op -Wno-restrict -Wno-array-bounds>)
if(LAPSERVO_SANITIZE)
  # Not those checks of UBSan that AddressSanitizer makes as well: they take a quarter of the time to compile Eigen.
  add_compile_options(-fsanitize=address,undefined -fno-sanitize=null,object-size,pointer-overflow,vptr,alignment
    -fno-sanitize-recover=undefined -fno-omit-frame-pointer)
  add_link_options(-fsanitize=address,undefined -fno-sanitize=vptr -fuse-ld=lld)
endif()

# For what reads what others wrote: bytes that are cast to numbers are aligned, and libFuzzer sees which branches an input
# takes (what -fsanitize=fuzzer-no-link means, but that one does not go with headers that were precompiled without).
function(lapservo_fuzzed target)
  if(LAPSERVO_SANITIZE)
    target_compile_options(${target} PRIVATE -fsanitize=alignment)
  endif()
  if(LAPSERVO_BUILD_FUZZERS)
    target_compile_options(${target} PRIVATE -fsanitize-coverage=inline-8bit-counters,indirect-calls,trace-cmp,pc-table)
    set_target_properties(${target} PROPERTIES LAPSERVO_FUZZED ON)
  endif()
endfunction()

# One set of flags for all targets, so that they share precompiled headers. -fno-semantic-interposition: nobody replaces our
# functions at load time, so the compiler may inline them. The definitions of libraries whose headers are precompiled go to
# all targets.
add_compile_options(-fPIC -fno-semantic-interposition)
if(LAPSERVO_PRECOMPILE_HEADERS)
  if(CMAKE_CXX_COMPILER_ID MATCHES Clang)
    add_compile_options("SHELL:-Xclang -fno-pch-timestamp")  # the same header has the same bytes, for ccache
  endif()
  add_compile_definitions($<TARGET_PROPERTY:fmt::fmt,INTERFACE_COMPILE_DEFINITIONS>)
  file(GENERATE OUTPUT ${CMAKE_BINARY_DIR}/precompiled.cpp CONTENT "")
  function(lapservo_precompiled_headers target)
    add_library(${target} OBJECT ${CMAKE_BINARY_DIR}/precompiled.cpp)
    target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR})
    target_precompile_headers(${target} PRIVATE <Eigen/Core> <Eigen/Geometry> <Eigen/Cholesky> <Eigen/LU> <algorithm> <array>
      <atomic> <chrono> <cmath> <cstddef> <condition_variable> <deque> <filesystem> <fmt/format.h> <functional> <limits> <map>
      <memory> <mutex> <numbers> <opencv2/core.hpp> <optional> <span> <string> <string_view> <thread> <utility> <variant>
      <vector> "$<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/lapservo/rig/rig.h>" ${ARGN})
    target_link_libraries(${target} PRIVATE lapservo_flags Eigen3::Eigen fmt::fmt opencv_core)
  endfunction()
  lapservo_precompiled_headers(lapservo_precompiled)
  if(LAPSERVO_BUILD_TESTS)
    lapservo_precompiled_headers(lapservo_test_precompiled <gtest/gtest.h>)
    target_link_libraries(lapservo_test_precompiled PRIVATE GTest::gtest)
    if(LAPSERVO_SANITIZE)
      target_compile_options(lapservo_test_precompiled PRIVATE -O0)
    endif()
  endif()
endif()
