// What runs of a program that died have left behind: an output at a voltage, and a journal.
#pragma once

#include <functional>
#include <string>

namespace ferrobench::server {

// Brings those outputs to zero at a bounded slew, each through the device as its run had configured it; then
// makes the recordings of the folder whole. What cannot be done is told as `failed`, with what to do, and
// keeps nothing else from being done. `unit`: serial number of the one whose output may not be at zero, else
// "".
using Tell = std::function<void(bool failed, const std::string& text, const std::string& unit)>;
void put_right(const std::string& folder, const Tell& tell);

}  // namespace ferrobench::server
