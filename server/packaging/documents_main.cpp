// ferrobench_documents FOLDER: writes the files of documents.h there. The build runs it.
#include <filesystem>
#include <fstream>
#include <iostream>

#include "recordings/format/version.h"
#include "server/cli/cli.h"
#include "server/packaging/documents.h"

namespace fs = std::filesystem;

namespace {

void write(const fs::path& file, const std::string& text) {
  std::ofstream out(file, std::ios::binary);
  out << text;
  out.close();
  if (!out) throw std::runtime_error(file.string() + " cannot be written");
}

}  // namespace

int main(int argc, char** argv) {
  using namespace ferrobench;
  try {
    if (argc != 2) throw std::runtime_error("usage: ferrobench_documents FOLDER");
    const fs::path folder = argv[1];
    fs::create_directories(folder / "schemas");
    CLI::App program;
    cli::Common common;
    cli::build_program(program, common);
    write(folder / "ferrobench.1",
          packaging::manual_page(program, std::string(recordings::software_version())));
    write(folder / "ferrobench.bash", packaging::bash_completion(program));
    for (const auto& [name, schema] : packaging::schemas())
      write(folder / "schemas" / name, schema.dump(2) + "\n");
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 1;
  }
  return 0;
}
