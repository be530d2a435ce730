// The secret that a client must show: 32 random bytes as hexadecimal digits in a file that only its owner may
// read.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace ferrobench::server {

// $XDG_STATE_HOME/ferrobench, else ~/.local/state/ferrobench. Error(io_error) if neither is known.
std::filesystem::path state_folder();

// Reads the token, or creates it (and its folder, mode 0700) at the first start. Refuses a file that others
// may read, that somebody else owns, or that holds anything but a token: Error(io_error) with the way to put
// it right.
std::string load_or_create_token(const std::filesystem::path& file);
// The same without creating one: Error(io_error) if it is not there.
std::string load_token(const std::filesystem::path& file);

// 64 hexadecimal digits that nobody can guess.
std::string random_secret();

// In a time that depends on the lengths only.
bool equal_secret(std::string_view a, std::string_view b);

}  // namespace ferrobench::server
