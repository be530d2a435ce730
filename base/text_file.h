// The text of a file that somebody named, which may be anything: what is no regular file is never waited for,
// and there is an end to what is read.
#pragma once

#include <string>

#include "base/error.h"

namespace ferrobench {

// Pipes are what a shell makes of <(command). One that nobody writes to is empty.
enum class Pipes { refuse, read };

// Error(not_found) if there is none or it is something else, Error(io_error) if it cannot be read,
// Error(code) if it has more than `most` bytes.
std::string read_text_file(const std::string& path, std::size_t most, ErrorCode code,
                           Pipes pipes = Pipes::refuse);

}  // namespace ferrobench
