#include "recordings/exchange/testers/radiant.h"

#include <algorithm>
#include <array>

#include "recordings/exchange/testers/lines.h"
#include "recordings/exchange/testers/number_rows.h"

namespace ferrobench::recordings {
namespace {

constexpr std::string_view left_1252 = "\xbb", left_utf8 = "\xc2\xbb";

constexpr std::array<std::pair<std::string_view, Measurement>, 3> tasks{
    {{"Hysteresis", Measurement::hysteresis},
     {"Remanent Hysteresis", Measurement::remanent_hysteresis},
     {"Leakage", Measurement::leakage}}};

bool is_quoted(std::string_view line) {
  return line.starts_with(left_1252) || line.starts_with(left_utf8);
}

// "Hysteresis" out of a line of angle quotes; "" for a row of nothing but quotes.
std::string title_of(std::string_view line) {
  constexpr std::string_view quotes = "\xc2\xbb\xab \t";
  const auto first = line.find_first_not_of(quotes);
  if (first == std::string_view::npos) return "";
  return std::string(line.substr(first, line.find_last_not_of(quotes) - first + 1));
}

// Where Vision names the columns it forgets to end the line before: "Valid DataPoint <tab> Time (ms)".
bool names_columns(std::string_view line) {
  const auto tab = line.find('\t');
  return tab != std::string_view::npos && line.substr(0, tab).ends_with("Point") &&
         line.substr(tab + 1).starts_with("Time (");
}

class RadiantFile {
 public:
  RadiantFile(std::string_view text, const Progress& progress) : lines_(text), progress_(progress) {}

  std::vector<TesterTable> read() {
    while (lines_.next()) {
      const auto line = trimmed(lines_.text());
      if (line.empty()) continue;
      if (is_quoted(line)) {
        take_title(line);
      } else if (names_columns(lines_.text())) {
        read_table();
      } else if (!tables_.empty() && tables_.back().rows() > 0 && !open_) {
        tables_.back().figures.push_back(to_utf8(line));
      } else {
        header_.push_back({to_utf8(line), lines_.number()});
      }
    }
    if (tables_.empty() || open_)
      lines_.refuse("the file ends here, and no columns came after the header", "",
                    "the file was cut off or changed; export it once more");
    return std::move(tables_);
  }

 private:
  void take_title(std::string_view line) {
    const auto title = title_of(line);
    if (const auto task = std::ranges::find(tasks, title, [](const auto& t) { return t.first; });
        task != tasks.end()) {
      task_ = &*task;
      header_.clear();
      open_ = true;
    } else if (task_ == nullptr) {
      auto allowed = nlohmann::json::array();
      for (const auto& [name, kind] : tasks) allowed.push_back(name);
      lines_.refuse("names no task that is read here", to_utf8(title), "", allowed);
    }
    // What Vision says of itself stands behind quotes, too.
    if (line.find(':') != std::string_view::npos) header_.push_back({to_utf8(title), lines_.number()});
  }

  void read_table() {
    if (task_ == nullptr)
      lines_.refuse("has columns, and no line before names the task", trimmed(lines_.text()),
                    "the file was changed; export it once more");
    TesterTable table{.tester = "Radiant Vision",
                      .measurement = std::string(task_->first),
                      .label = std::string(task_->first),
                      .kind = task_->second,
                      .file_header = {},
                      .header = std::move(header_),
                      .columns = {}};
    header_.clear();
    open_ = false;
    const std::string headings(lines_.text());
    read_headings(headings, table);
    table.columns.front().name = "Point";
    NumberRows(lines_, progress_).read(table);
    if (const auto task = table.find("Task Name"); task && !task->text.empty()) table.label = task->text;
    check_points(table);
    tables_.push_back(std::move(table));
  }

  void check_points(const TesterTable& table) {
    const auto stated = table.find("Points");
    const auto rows = table.rows();
    if (rows == 0) lines_.refuse("there are no rows below the columns", "", "export the file once more");
    if (stated && stated->number && *stated->number != static_cast<double>(rows))
      lines_.refuse("line " + std::to_string(stated->line) + " says that there are " + stated->text +
                        " points, and there are " + std::to_string(rows),
                    "", "the file was cut off or changed; export it once more");
    const auto& points = table.columns.front().values;
    for (std::size_t i = 0; i < rows; ++i)
      if (points[i] != static_cast<double>(i + 1))
        throw Error(ErrorCode::bad_recording, "the file is not what its kind of file should be",
                    Problem{.message = "line " + std::to_string(table.line_of(i)) +
                                       ": the points are not numbered one by one",
                            .given = points[i],
                            .allowed = i + 1,
                            .hint = "the file was changed; export it once more"});
  }

  Lines lines_;
  const Progress& progress_;
  const std::pair<std::string_view, Measurement>* task_ = nullptr;
  bool open_ = false;  // a task's title has come, its columns have not
  std::vector<HeaderLine> header_;
  std::vector<TesterTable> tables_;
};

}  // namespace

bool looks_like_radiant(std::string_view text) {
  constexpr std::size_t looked_at = 4096;
  Lines lines(text.substr(0, looked_at));
  while (lines.next())
    if (!lines.is_blank()) return is_quoted(lines.text());
  return false;
}

std::vector<TesterTable> read_radiant(std::string_view text, const Progress& progress) {
  return RadiantFile(text, progress).read();
}

}  // namespace ferrobench::recordings
