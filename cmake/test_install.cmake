# Installs BUILD into a fresh prefix, builds EXAMPLE against it, and runs it on a picture that the installed tool renders.
set(folder ${BUILD}/install-test)
set(prefix ${folder}/prefix)

function(run)
  execute_process(COMMAND ${ARGV} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

file(REMOVE_RECURSE ${folder})
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${prefix})
run(${CMAKE_COMMAND} -S ${EXAMPLE} -B ${folder}/build -G Ninja -DCMAKE_PREFIX_PATH=${prefix} -DCMAKE_BUILD_TYPE=Release
    -DCMAKE_CXX_COMPILER=${COMPILER} -DCMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER})
run(${CMAKE_COMMAND} --build ${folder}/build)
run(${prefix}/bin/lapservo render --rig ${prefix}/share/lapservo/configs/example.yaml --out ${folder}/frames --count 1)
run(${folder}/build/rotation ${folder}/frames/rig.yaml ${folder}/frames/0000.png)
