# What lapservo_module() was told, kept for check_boundaries.cmake, which compares what the files include with it.
function(lapservo_remember_module name folder)
  cmake_parse_arguments(M "" "" "PUBLIC_HEADERS;SOURCES;USES;PRIVATE;TESTS;LONG_TESTS;TEST_USES" ${ARGN})
  set(text "list(APPEND modules ${name})\nset(${name}_FOLDER lapservo/${folder})\n")
  foreach(what IN ITEMS PUBLIC_HEADERS USES PRIVATE TESTS LONG_TESTS TEST_USES)
    string(APPEND text "set(${name}_${what} \"${M_${what}}\")\n")
  endforeach()
  set_property(GLOBAL APPEND_STRING PROPERTY LAPSERVO_MODULES "${text}")
endfunction()

# After the last module.
function(lapservo_check_boundaries)
  get_property(modules GLOBAL PROPERTY LAPSERVO_MODULES)
  file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/modules.cmake CONTENT "@modules@" @ONLY)
  if(LAPSERVO_BUILD_TESTS)
    add_test(NAME boundaries COMMAND ${CMAKE_COMMAND} -DMODULES=${PROJECT_BINARY_DIR}/modules.cmake
             -DSOURCE=${PROJECT_SOURCE_DIR} -P ${PROJECT_SOURCE_DIR}/cmake/check_boundaries.cmake)
  endif()
endfunction()
