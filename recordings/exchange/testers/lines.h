// The text of a tester's file, line by line. It comes from outside: lines have a greatest length, and a byte
// that no tester writes is an error with its line.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"

namespace ferrobench::recordings {

class Lines {
 public:
  explicit Lines(std::string_view text);  // passes over a byte-order mark; Error(bad_recording) for UTF-16

  bool next();                                     // false at the end
  void go_back();                                  // the line comes once more
  std::string_view text() const { return line_; }  // without its end
  std::size_t number() const { return number_; }   // from 1
  std::size_t offset() const { return begin_; }    // of the line in the text
  bool is_blank() const;
  double share_done() const;

  // Error(bad_recording) that names the line and quotes what was found.
  [[noreturn]] void refuse(const std::string& message, std::string_view given, const std::string& hint = "",
                           const nlohmann::json& allowed = nullptr) const;

 private:
  std::string_view text_, line_;
  std::size_t begin_ = 0, end_ = 0, number_ = 0;
};

// As it is where it is UTF-8, else out of Windows' code page 1252.
std::string to_utf8(std::string_view bytes);
std::string_view trimmed(std::string_view text);
// The cells between tabs; those that are empty at the end, as a spreadsheet pads a line, are left out.
void split_tabs(std::string_view line, std::vector<std::string_view>& cells);

}  // namespace ferrobench::recordings
