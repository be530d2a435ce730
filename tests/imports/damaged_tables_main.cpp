// ferrobench_damaged_tables COPIES SEED FOLDER [FILES]: damages files of its own, or those that are named.
#include <fstream>
#include <iostream>
#include <iterator>

#include "tests/imports/damaged_tables.h"

int main(int argc, char** argv) {
  if (argc < 4) {
    std::cerr << "ferrobench_damaged_tables COPIES SEED FOLDER [FILES]\n";
    return 2;
  }
  using namespace ferrobench::imports;
  std::vector<NamedFile> files;
  for (int i = 4; i < argc; ++i) {
    std::ifstream in(argv[i], std::ios::binary);
    files.push_back(
        {std::filesystem::path(argv[i]).filename().string(), {std::istreambuf_iterator<char>(in), {}}});
  }
  if (files.empty()) files = all_files();
  // To compare a copy with.
  std::filesystem::create_directories(argv[3]);
  for (const auto& file : files)
    std::ofstream(std::filesystem::path(argv[3]) / ("sound-" + file.name), std::ios::binary) << file.text;
  const auto figures = damage_tables(files, std::stoi(argv[1]), std::stoull(argv[2]), argv[3]);
  std::cout << figures;
  return figures.failures.empty() ? 0 : 1;
}
