# CMake's regular expressions know nine groups; ctest leaves a filter with more aside without a word.
cmake_minimum_required(VERSION 3.25)
file(READ ${CMAKE_CURRENT_LIST_DIR}/../CMakePresets.json presets)
string(JSON count LENGTH ${presets} testPresets)
math(EXPR last "${count} - 1")
foreach(i RANGE ${last})
  foreach(kind include exclude)
    string(JSON name ERROR_VARIABLE none GET ${presets} testPresets ${i} filter ${kind} name)
    if(NOT none)
      string(REGEX MATCH "${name}" matched "a test")  # an error when it is no expression
    endif()
  endforeach()
endforeach()
