// What an installed ferrobench has beside the program: manual page and shell completion from the tables of
// the command line, and the JSON Schemas of the files that a user writes.
#pragma once

#include <CLI/CLI.hpp>
#include <map>
#include <nlohmann/json.hpp>
#include <string>

namespace ferrobench::packaging {

// ferrobench.1, for man.
std::string manual_page(const CLI::App& program, const std::string& version);
// For bash: commands, options, the values of options that allow few, shipped names; else files.
std::string bash_completion(const CLI::App& program);
// By file name.
std::map<std::string, nlohmann::json> schemas();

}  // namespace ferrobench::packaging
