// Text from outside, for people to read.
#pragma once

#include <string>
#include <string_view>

namespace ferrobench {

// In one line that tells a terminal nothing: control characters, marks that turn the direction of writing,
// and bytes that are no UTF-8 are spelled out ("\n", "\x1b", "\u202e").
std::string visible(std::string_view text);

// An error's lines as a part of a sentence.
std::string in_one_line(std::string_view error_text);

}  // namespace ferrobench
