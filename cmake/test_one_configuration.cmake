# What is compiled, and how, does not depend on whether ccache is installed, nor on the way to configure: ./dev's preset without and
# with ccache and a plain `cmake -B build` have the same files with the same commands.
cmake_minimum_required(VERSION 3.25)

# The commands of a build tree that FOLDER was configured into, with the folder's name taken out.
function(commands_of folder result)
  file(READ ${folder}/compile_commands.json json)
  string(REPLACE "${folder}" "BUILD" json "${json}")
  set(${result} "${json}" PARENT_SCOPE)
endfunction()

function(configure name)
  execute_process(COMMAND ${CMAKE_COMMAND} -S ${SOURCE} -B ${OUT}/${name} --fresh -G Ninja -DCMAKE_CXX_COMPILER=${COMPILER} ${ARGN}
                  OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
endfunction()

configure(plain)
configure(preset --preset release)
set(ENV{CMAKE_CXX_COMPILER_LAUNCHER} env)  # in the place of ccache, which may not be installed
configure(launcher --preset release)
commands_of(${OUT}/plain expected)
foreach(name preset launcher)
  commands_of(${OUT}/${name} commands)
  if(NOT commands STREQUAL expected)
    message(FATAL_ERROR "${OUT}/${name}/compile_commands.json differs from ${OUT}/plain's")
  endif()
endforeach()
