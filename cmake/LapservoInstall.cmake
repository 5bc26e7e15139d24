# `cmake --install build --prefix X`: the tool with its manual pages and completion, the libraries with their public headers,
# what find_package(lapservo) and pkg-config find, example rigs, a picture, ROS 2's
# package of the message type and the licence. Targets join the exports where
# they are declared.
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
install(FILES acceptance/frames/png/0000.png acceptance/frames/png/rig.yaml DESTINATION ${CMAKE_INSTALL_DATADIR}/lapservo/example)
install(DIRECTORY transports/ros2/msg/lapservo_msgs DESTINATION ${CMAKE_INSTALL_DATADIR}/lapservo)
# What `ros2 launch lapservo` and other tools of ROS 2 look for: the package's name in an index, and its launch files.
install(FILES package.xml DESTINATION ${CMAKE_INSTALL_DATADIR}/lapservo)
install(DIRECTORY transports/ros2/launch DESTINATION ${CMAKE_INSTALL_DATADIR}/lapservo)
file(WRITE ${PROJECT_BINARY_DIR}/ament_index/lapservo "")
install(FILES ${PROJECT_BINARY_DIR}/ament_index/lapservo DESTINATION ${CMAKE_INSTALL_DATADIR}/ament_index/resource_index/packages)
# colcon.pkg names these: colcon itself puts packages of the build type cmake into no index.
file(WRITE ${PROJECT_BINARY_DIR}/hook/ament_prefix_path.dsv "prepend-non-duplicate;AMENT_PREFIX_PATH;\n")
file(WRITE ${PROJECT_BINARY_DIR}/hook/ament_prefix_path.sh "_colcon_prepend_unique_value AMENT_PREFIX_PATH \"$COLCON_CURRENT_PREFIX\"\n")
install(DIRECTORY ${PROJECT_BINARY_DIR}/hook DESTINATION ${CMAKE_INSTALL_DATADIR}/lapservo)
# A test that needs nothing but the tool: `colcon test` has it without the others, too.
find_program(LAPSERVO_PYTHON python3)
if(LAPSERVO_PYTHON AND NOT LAPSERVO_SANITIZE)
  add_test(NAME packaging.ros2 COMMAND ${LAPSERVO_PYTHON} ${PROJECT_SOURCE_DIR}/transports/ros2/test_ros2_package.py
           $<TARGET_FILE:lapservo_app> ${PROJECT_SOURCE_DIR})
endif()
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR})

if(TARGET lapservo_shared)
  install(TARGETS lapservo_shared EXPORT lapservoSharedTargets INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
  install(EXPORT lapservoSharedTargets NAMESPACE lapservo:: DESTINATION ${package_folder})
  file(RELATIVE_PATH LAPSERVO_PREFIX_FROM_PC /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
  list(GET OpenCV_INCLUDE_DIRS 0 LAPSERVO_OPENCV_INCLUDE)
  configure_file(cmake/lapservo.pc.in lapservo.pc @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/lapservo.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
endif()

# A sanitized library can't be linked by those who are not sanitized.
if(LAPSERVO_BUILD_TESTS AND NOT LAPSERVO_SANITIZE)
  add_test(NAME install.find_package
           COMMAND ${CMAKE_COMMAND} -DBUILD=${PROJECT_BINARY_DIR} -DEXAMPLES=${PROJECT_SOURCE_DIR}/examples
                   -DCOMPILER=${CMAKE_CXX_COMPILER} -DLAUNCHER=${CMAKE_CXX_COMPILER_LAUNCHER}
                   -P ${PROJECT_SOURCE_DIR}/cmake/test_install.cmake)
  # No semicolon in it: it would be two expressions, of which one always matches.
  set_tests_properties(install.find_package PROPERTIES TIMEOUT 900 PASS_REGULAR_EXPRESSION
                       " mm, .* rad\nRCM at .*at most .* mrad\n(psi = -?[0-9.]+ rad, sigma = 0\\.0[0-9]+ rad\n)+(.*\n)?converged. ")
endif()
