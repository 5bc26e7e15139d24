# liblapservo.so: the folders that have public headers as one shared library, which exports what is public and nothing of
# lapservo::internal. The tool, Python and the tests need what is internal and take the folders' static libraries.
get_property(lapservo_public_modules GLOBAL PROPERTY LAPSERVO_PUBLIC_MODULES)
get_property(lapservo_components GLOBAL PROPERTY LAPSERVO_COMPONENTS)
if(LAPSERVO_SANITIZE)  # nobody who is not sanitized could link it
  return()
endif()

set(archives)
foreach(module IN LISTS lapservo_public_modules)
  get_target_property(type lapservo_${module} TYPE)
  if(type STREQUAL STATIC_LIBRARY)
    list(APPEND archives lapservo_${module})
  endif()
endforeach()
list(TRANSFORM archives REPLACE "(.+)" "$<TARGET_OBJECTS:\\1>" OUTPUT_VARIABLE objects)

configure_file(${CMAKE_CURRENT_LIST_DIR}/exported_symbols.map.in exported_symbols.map @ONLY)
add_library(lapservo_shared SHARED ${objects})
set_target_properties(lapservo_shared PROPERTIES OUTPUT_NAME lapservo EXPORT_NAME lapservo LIBRARY_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}
  LINKER_LANGUAGE CXX VERSION ${PROJECT_VERSION} SOVERSION ${LAPSERVO_SOVERSION} LINK_DEPENDS ${PROJECT_BINARY_DIR}/exported_symbols.map)
target_compile_features(lapservo_shared INTERFACE cxx_std_20)
target_link_libraries(lapservo_shared PRIVATE ${archives} INTERFACE Eigen3::Eigen)  # archives: for what they link
target_link_options(lapservo_shared PRIVATE
  -Wl,--version-script=${PROJECT_BINARY_DIR}/exported_symbols.map -Wl,-z,defs -Wl,--as-needed)

if(LAPSERVO_BUILD_TESTS)
  list(TRANSFORM archives REPLACE "(.+)" "$<TARGET_FILE:\\1>" OUTPUT_VARIABLE archive_files)
  add_test(NAME install.exported_symbols
           COMMAND ${CMAKE_COMMAND} -DNM=${CMAKE_NM} -DSOVERSION=${LAPSERVO_SOVERSION} -DSHARED=$<TARGET_FILE:lapservo_shared> "-DARCHIVES=${archive_files}"
                   -P ${CMAKE_CURRENT_LIST_DIR}/test_exports.cmake)
endif()
