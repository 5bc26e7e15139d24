# Installs BUILD into a fresh prefix, builds the projects in EXAMPLES against it, and runs them: on a picture that the
# installed tool renders, and around a robot of their own.
set(folder ${BUILD}/install-test)
set(prefix ${folder}/prefix)

function(run)
  execute_process(COMMAND ${ARGV} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

function(build_example name)
  run(${CMAKE_COMMAND} -S ${EXAMPLES}/${name} -B ${folder}/${name} -G Ninja -DCMAKE_PREFIX_PATH=${prefix}
      -DCMAKE_BUILD_TYPE=Release -DCMAKE_CXX_COMPILER=${COMPILER} -DCMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER})
  run(${CMAKE_COMMAND} --build ${folder}/${name})
endfunction()

file(REMOVE_RECURSE ${folder})
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${prefix})
build_example(find_package)
build_example(own_robot)
run(${prefix}/bin/lapservo render --rig ${prefix}/share/lapservo/configs/example.yaml --out ${folder}/frames --count 1)
run(${folder}/find_package/rotation ${folder}/frames/rig.yaml ${folder}/frames/0000.png)
run(${folder}/own_robot/own_robot ${prefix}/share/lapservo/configs/paper.yaml)
