#include <cstdio>
#include <exception>

#include "apps/lapservo/subcommands.h"
#include "lapservo/core/error.h"

namespace {
constexpr int bad_input = 2;
}

int main(int argc, char** argv) {
  CLI::App app{"See and steer a laparoscopic instrument by its camera.", "lapservo"};
  app.require_subcommand(1);
  lapservo::app::Run run;
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : bad_input;
  }
  try {
    return run();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "lapservo: %s\n", error.what());
    return bad_input;
  }
}
