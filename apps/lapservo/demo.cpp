// The tool with the experiments alone, two thirds of the compilation: `./dev demo`.

#include "apps/lapservo/cli/command.h"
#include "apps/lapservo/cli/subcommands.h"

int main(int argc, char** argv) {
  return lapservo::app::run_program(argc, argv, {lapservo::app::add_experiment});
}
