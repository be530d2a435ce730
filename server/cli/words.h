// What people read at the command line: where a problem is, as they gave it, and what to do, as a command.
#pragma once

#include <CLI/CLI.hpp>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"

namespace ferrobench::cli {

// The library speaks of JSON pointers and of methods. Here a problem leads to the option or to the place in
// the file that the user gave ("mine.json: /segments/3/rate", "--set rate"), and a hint names the command.
Error in_users_words(const Error& error, const CLI::App& command);
// "see recording.list" as "see 'ferrobench list'".
std::string with_commands(const std::string& hint);
// The table behind it: methods and the words after "ferrobench".
std::span<const std::pair<std::string_view, std::string_view>> hinted_commands();

// What is wrong with the words themselves: an unknown command or option with the nearest that there is.
std::string usage_in_words(const CLI::ParseError& error, const CLI::App& app);

// The subcommand that the user chose, the innermost.
const CLI::App& chosen(const CLI::App& app);

// Checks of an option's value, in words.
CLI::Validator one_of(std::vector<std::string> names);
CLI::Validator number_from(double low, double high = std::numeric_limits<double>::infinity());

}  // namespace ferrobench::cli
