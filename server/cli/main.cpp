#include "server/cli/cli.h"

int main(int argc, char** argv) {
  return ferrobench::cli::run_program(argc, argv);
}
