# `cmake --install build --prefix X`: the tool, the libraries with their public headers, the package that find_package(lapservo)
# finds, the example rigs and the licence. Targets join the export where they are declared.
include(CMakePackageConfigHelpers)

set(LAPSERVO_INSTALL_CONFIGSDIR ${CMAKE_INSTALL_DATADIR}/lapservo/configs)
set(package_folder ${CMAKE_INSTALL_LIBDIR}/cmake/lapservo)
configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/lapservoConfig.cmake.in lapservoConfig.cmake
  INSTALL_DESTINATION ${package_folder} PATH_VARS LAPSERVO_INSTALL_CONFIGSDIR)
write_basic_package_version_file(lapservoConfigVersion.cmake COMPATIBILITY SameMinorVersion)

install(EXPORT lapservoTargets NAMESPACE lapservo:: DESTINATION ${package_folder})
install(FILES ${PROJECT_BINARY_DIR}/lapservoConfig.cmake ${PROJECT_BINARY_DIR}/lapservoConfigVersion.cmake
        DESTINATION ${package_folder})
install(DIRECTORY configs/ DESTINATION ${LAPSERVO_INSTALL_CONFIGSDIR})
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR})

# A sanitized library can't be linked by those who are not sanitized.
if(LAPSERVO_BUILD_TESTS AND NOT LAPSERVO_SANITIZE)
  add_test(NAME install.find_package
           COMMAND ${CMAKE_COMMAND} -DBUILD=${PROJECT_BINARY_DIR} -DEXAMPLES=${PROJECT_SOURCE_DIR}/examples
                   -DCOMPILER=${CMAKE_CXX_COMPILER} -DLAUNCHER=${CMAKE_CXX_COMPILER_LAUNCHER}
                   -P ${PROJECT_SOURCE_DIR}/cmake/test_install.cmake)
  # No semicolon in it: it would be two expressions, of which one always matches.
  set_tests_properties(install.find_package PROPERTIES TIMEOUT 600 PASS_REGULAR_EXPRESSION
                       "psi = -?[0-9.]+ rad, sigma = 0\\.0[0-9]+ rad\n(.*\n)?converged. ")
endif()
