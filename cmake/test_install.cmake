# Installs BUILD into a fresh prefix, compiles every installed header on its own, builds the projects in EXAMPLES against
# the prefix, by CMake with the shared library and with static ones and by pkg-config, and runs them: on pictures that the
# installed tool renders, and around a robot of their own.
cmake_minimum_required(VERSION 3.25)
set(folder ${BUILD}/install-test)
set(prefix ${folder}/prefix)

function(run)
  execute_process(COMMAND ${ARGV} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

# Further arguments go to CMake.
function(build_project source name)
  run(${CMAKE_COMMAND} -S ${source} -B ${folder}/${name} -G Ninja -DCMAKE_PREFIX_PATH=${prefix} ${ARGN}
      -DCMAKE_BUILD_TYPE=Release -DCMAKE_CXX_COMPILER=${COMPILER} -DCMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER})
  run(${CMAKE_COMMAND} --build ${folder}/${name})
endfunction()

# Whether the header's own source includes it before all others, so that building lapservo has shown that it stands alone.
function(compiles_first header result)
  string(REGEX REPLACE "h$" "cpp" source ${CMAKE_CURRENT_LIST_DIR}/../${header})
  set(${result} OFF PARENT_SCOPE)
  if(EXISTS ${source})
    file(STRINGS ${source} first REGEX "^#include" LIMIT_COUNT 1)
    if(first STREQUAL "#include \"${header}\"")
      set(${result} ON PARENT_SCOPE)
    endif()
  endif()
endfunction()

# A project in which each header is a source of its own, but for those that the build has shown already; lapservo.h has all. Fails, too, when others than the public ones are installed.
function(check_headers)
  file(GLOB_RECURSE headers RELATIVE ${prefix}/include ${prefix}/include/*)
  include(${BUILD}/modules.cmake)
  set(expected lapservo/lapservo.h)
  foreach(module IN LISTS modules)
    foreach(header IN LISTS ${module}_PUBLIC_HEADERS)
      list(APPEND expected lapservo/${module}/${header})
    endforeach()
  endforeach()
  list(SORT headers)
  list(SORT expected)
  if(NOT headers STREQUAL expected)
    message(FATAL_ERROR "installed are the headers ${headers}, expected ${expected}")
  endif()
  foreach(header IN LISTS headers)
    compiles_first(${header} compiled)
    if(compiled)
      continue()
    endif()
    string(MAKE_C_IDENTIFIER ${header} name)
    file(WRITE ${folder}/each_header/${name}.cpp "#include <${header}>\n")
  endforeach()
  file(WRITE ${folder}/each_header/CMakeLists.txt "cmake_minimum_required(VERSION 3.25)
project(each_header LANGUAGES CXX)
find_package(lapservo REQUIRED)
file(GLOB sources *.cpp)
add_library(each_header OBJECT \${sources})
target_compile_options(each_header PRIVATE -O0 -Wall -Wextra -Werror)
target_link_libraries(each_header PRIVATE lapservo::lapservo)
")
  build_project(${folder}/each_header each_header.build)
endfunction()

# Who controls and sees nothing needs no package for pictures, with static libraries.
function(check_control_alone)
  file(WRITE ${folder}/control_alone/main.cpp "#include <lapservo/control/hold_reason.h>
int main() { return lapservo::to_string(lapservo::HoldReason::outlier) == \"outlier\" ? 0 : 1; }
")
  file(WRITE ${folder}/control_alone/CMakeLists.txt "cmake_minimum_required(VERSION 3.25)
project(control_alone LANGUAGES CXX)
find_package(lapservo REQUIRED COMPONENTS control)
add_executable(control_alone main.cpp)
target_link_libraries(control_alone PRIVATE lapservo::control)
")
  build_project(${folder}/control_alone control_alone.build -DCMAKE_DISABLE_FIND_PACKAGE_OpenCV=ON
                -DCMAKE_DISABLE_FIND_PACKAGE_PkgConfig=ON -DCMAKE_DISABLE_FIND_PACKAGE_hwy=ON)
  run(${folder}/control_alone.build/control_alone)
endfunction()

# A program may as well be built by pkg-config, and finds the library where it was linked.
function(build_by_pkg_config source program)
  file(GLOB_RECURSE pc ${prefix}/lapservo.pc)
  get_filename_component(pc_folder ${pc} DIRECTORY)
  get_filename_component(libraries ${pc_folder} DIRECTORY)
  execute_process(COMMAND ${CMAKE_COMMAND} -E env PKG_CONFIG_PATH=${pc_folder} pkg-config --cflags --libs "lapservo < 0.2"
                  OUTPUT_VARIABLE flags OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
  separate_arguments(flags)
  run(${LAUNCHER} ${COMPILER} -std=c++20 ${source} -o ${program} ${flags} -Wl,-rpath,${libraries})
endfunction()

# The examples of some twenty lines, each run.
function(run_examples)
  set(frames ${folder}/swing)
  run(${prefix}/bin/lapservo render --rig ${prefix}/share/lapservo/configs/paper.yaml --out ${frames} --count 12 --moving)
  run(${folder}/cpp/track_video ${frames} ${frames}/rig.yaml)
  run(${folder}/cpp/rcm_image ${frames} ${frames}/rig.yaml)
  run(${folder}/cpp/marker_5mm ${folder}/sheet.pdf)
endfunction()

file(REMOVE_RECURSE ${folder})
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${prefix})
check_headers()
check_control_alone()
build_project(${EXAMPLES}/find_package find_package -Dlapservo_USE_STATIC_LIBS=ON)
build_project(${EXAMPLES}/cpp cpp)
build_project(${EXAMPLES}/own_robot own_robot)
build_by_pkg_config(${EXAMPLES}/find_package/rotation.cpp ${folder}/rotation)
run_examples()
set(example ${prefix}/share/lapservo/example)
run(${folder}/rotation ${example}/rig.yaml ${example}/0000.png)
run(${folder}/find_package/rotation ${example}/rig.yaml ${example}/0000.png)
run(${folder}/own_robot/own_robot ${prefix}/share/lapservo/configs/paper.yaml)
