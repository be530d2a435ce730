#include "recordings/exchange/testers/easyexpert.h"

#include <algorithm>
#include <map>

#include "base/fields.h"
#include "base/number_text.h"
#include "recordings/exchange/testers/lines.h"
#include "recordings/exchange/testers/number_rows.h"

namespace ferrobench::recordings {
namespace {

std::vector<std::string_view> cells_of(std::string_view line) {
  std::vector<std::string_view> out;
  for (;;) {
    const auto comma = line.find(',');
    out.push_back(trimmed(line.substr(0, comma)));
    if (comma == std::string_view::npos) return out;
    line.remove_prefix(comma + 1);
  }
}

bool is_word(std::string_view text) {
  return !text.empty() && std::ranges::all_of(text, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
  });
}

class EasyExpertFile {
 public:
  explicit EasyExpertFile(std::string_view text) : text_(text), lines_(text) {}

  std::vector<EasyExpertRecord> read() {
    while (lines_.next()) {
      if (lines_.is_blank()) continue;
      const auto cells = cells_of(lines_.text());
      if (cells[0] == "DataValue")
        take_row(cells);
      else if (cells[0] == "DataName")
        take_names(cells);
      else if (is_word(cells[0]) && cells.size() > 1 && (rows_ == 0 || cells[0] == "SetupTitle"))
        take_header(cells);
      else
        lines_.refuse("is no part of an EasyEXPERT file", lines_.text(),
                      "the file was changed; export it once more");
    }
    close();
    if (records_.empty())
      lines_.refuse("the file ends here, and there was no DataValue row in it", "",
                    "the file was cut off; export it once more");
    return std::move(records_);
  }

 private:
  void take_header(const std::vector<std::string_view>& cells) {
    if (rows_ > 0) close();
    now_.header.push_back({to_utf8(trimmed(lines_.text())), lines_.number()});
    if (cells[0] == "TestParameter" && cells[1] == "Name") parameters_.assign(cells.begin(), cells.end());
    if (cells[0] == "TestParameter" && cells[1] == "Value") take_modes(cells);
    if (cells[0] == "Dimension1") stated_ = number_of(cells[1]);
  }

  // "OperationMode2: Fast IV Imeas": MeasResult2 is a current.
  void take_modes(const std::vector<std::string_view>& values) {
    std::map<std::string, std::string> modes;
    for (std::size_t i = 2; i < std::min(values.size(), parameters_.size()); ++i)
      if (parameters_[i].starts_with("OperationMode"))
        modes[std::string(parameters_[i].substr(std::string_view("OperationMode").size()))] = values[i];
    if (!modes.empty()) modes_ = std::move(modes);
  }

  void take_names(const std::vector<std::string_view>& cells) {
    if (rows_ > 0) close();
    begin_rows();
    now_.named = true;
    names_.assign(cells.begin(), cells.end());
  }

  void begin_rows() {
    now_.first_line = lines_.number();
    begin_ = lines_.offset();
  }

  void take_row(const std::vector<std::string_view>& cells) {
    if (rows_ == 0 && !now_.named) {
      begin_rows();
      names_.assign(cells.size(), "");
    }
    if (cells.size() != names_.size())
      lines_.refuse("has " + std::to_string(cells.size()) + " columns, not " + std::to_string(names_.size()) +
                        (now_.named ? " as DataName" : " as the first row"),
                    cells.back(), "the file was cut off or changed; export it once more");
    find_copies(cells);
    compare_times(cells);
    ++rows_;
    now_.rows = text_.substr(begin_, lines_.offset() + lines_.text().size() - begin_);
  }

  // Without names: columns that say the same in the first row whose time is not zero do so in all.
  void find_copies(const std::vector<std::string_view>& cells) {
    if (now_.named || copies_known_ || cells.size() < 2 || number_of(cells[1]) == 0) return;
    copies_known_ = true;
    for (std::size_t k = 2; k < cells.size(); ++k)
      if (cells[k] == cells[1]) names_[1] = names_[k] = "copy_time";
  }

  // Each channel has its own; a recording has one.
  void compare_times(const std::vector<std::string_view>& cells) {
    std::optional<std::string_view> first;
    for (std::size_t i = 1; i < names_.size(); ++i) {
      if (!names_[i].ends_with("_time")) continue;
      if (!first)
        first = cells[i];
      else if (*first != cells[i] && differing_++ == 0)
        differs_at_ = lines_.number();
    }
  }

  void close() {
    if (rows_ == 0) {
      if (now_.named || !now_.header.empty())
        lines_.refuse("a record ends here without a DataValue row", "",
                      "the file was cut off; export it once more");
      return;
    }
    if (stated_ && *stated_ != static_cast<double>(rows_))
      lines_.refuse("the record before has " + std::to_string(rows_) +
                        " DataValue rows, and its Dimension1 says " + number_text(*stated_),
                    "", "the file was cut off or changed; export it once more");
    name_columns();
    records_.push_back(std::move(now_));
    now_ = {};
    rows_ = differing_ = 0;
    copies_known_ = false;
    stated_.reset();
    parameters_.clear();
  }

  void name_columns() {
    for (const auto& [number, mode] : modes_) {
      const auto value = "MeasResult" + number + "_value", time = "MeasResult" + number + "_time";
      if (std::ranges::find(names_, value) == names_.end()) continue;
      if (mode.ends_with("Vmeas") && now_.voltage.empty()) now_.voltage = value;
      if (mode.ends_with("Imeas") && now_.current.empty()) now_.current = value;
      if (now_.time.empty() && std::ranges::find(names_, time) != names_.end()) now_.time = time;
    }
    if (!now_.named) {
      if (differing_ > 0)
        now_.findings.push_back({"warning", "columns that are the same in the first row differ in " +
                                                std::to_string(differing_) + " others, first in line " +
                                                std::to_string(differs_at_)});
      return;
    }
    if (now_.time.empty()) return;
    if (differing_ == 0)
      now_.findings.push_back({"check", "the times of all channels are the same in every row"});
    else
      now_.findings.push_back({"warning", "the times of the channels differ in " +
                                              std::to_string(differing_) + " rows, first in line " +
                                              std::to_string(differs_at_) + "; that of " + now_.time +
                                              " is taken"});
  }

  std::string_view text_;
  Lines lines_;
  std::vector<EasyExpertRecord> records_;
  EasyExpertRecord now_;
  std::vector<std::string> names_, parameters_;
  std::map<std::string, std::string> modes_;
  std::optional<double> stated_;
  bool copies_known_ = false;
  std::size_t rows_ = 0, begin_ = 0, differing_ = 0, differs_at_ = 0;
};

std::string_view first_word(std::string_view text) {
  constexpr std::size_t looked_at = 4096;
  Lines lines(text.substr(0, looked_at));
  while (lines.next())
    if (!lines.is_blank()) {
      const auto line = trimmed(lines.text());
      return line.substr(0, line.find(','));
    }
  return "";
}

}  // namespace

bool looks_like_easyexpert(std::string_view text) {
  const auto word = first_word(text);
  return word == "SetupTitle" || word == "DataName" || word == "TestParameter" || word == "ApplicationTest";
}

bool looks_like_data_values(std::string_view text) {
  return first_word(text) == "DataValue";
}

std::vector<EasyExpertRecord> read_easyexpert(std::string_view text) {
  return EasyExpertFile(text).read();
}

}  // namespace ferrobench::recordings
