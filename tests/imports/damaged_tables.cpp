#include "tests/imports/damaged_tables.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <random>
#include <set>

#include "recordings/exchange/import.h"

namespace ferrobench::imports {

namespace fs = std::filesystem;
using recordings::Imported;

namespace {

using Random = std::mt19937_64;
constexpr unsigned patience = 120;  // s for one copy, under a sanitizer

// What a user would say of the file.
recordings::CsvImport given_for(const std::string& text) {
  recordings::CsvImport out;
  out.csv = text;
  const auto kind = recordings::detect_kind(text);
  using recordings::SourceKind;
  if (kind == SourceKind::aixacct || kind == SourceKind::radiant) return out;
  out.area = 1e-8, out.layer_thickness = 200e-9;
  using recordings::ColumnMap;
  if (kind == SourceKind::easyexpert) return out;
  out.time = ColumnMap{.number = 2};
  out.field = ColumnMap{.number = 4, .unit = "V"};
  if (kind == SourceKind::data_values)
    out.current = ColumnMap{.number = 3, .unit = "A"};
  else
    out.displacement = ColumnMap{.number = 3, .unit = "um"}, out.length = 0.02;
  return out;
}

std::vector<std::size_t> line_starts(const std::string& text) {
  std::vector<std::size_t> out{0};
  for (std::size_t i = 0; i + 1 < text.size(); ++i)
    if (text[i] == '\n') out.push_back(i + 1);
  out.push_back(text.size());
  return out;
}

std::string damaged(std::string text, Random& random) {
  const auto below = [&random](std::size_t count) {
    return static_cast<std::size_t>(random() % std::max<std::size_t>(count, 1));
  };
  const auto lines = [&] {
    const auto starts = line_starts(text);
    const auto at = below(starts.size() - 1);
    return std::pair{starts[at], starts[at + 1] - starts[at]};
  };
  switch (below(9)) {
    case 0:
      return text.substr(0, below(text.size()));
    case 1:  // bits
      for (auto times = 1 + below(8); times > 0; --times) {
        auto& c = text[below(text.size())];
        c = static_cast<char>(c ^ (1 << below(8)));
      }
      return text;
    case 2: {  // bytes
      const auto at = below(text.size()), length = std::min(1 + below(32), text.size() - at);
      const int with = static_cast<int>(below(3));
      for (auto i = at; i < at + length; ++i)
        text[i] = with == 0 ? '\0' : with == 1 ? '\xff' : static_cast<char>(below(256));
      return text;
    }
    case 3: {  // a piece elsewhere
      const auto piece = text.substr(below(text.size()), 1 + below(32));
      text.replace(below(text.size()), piece.size(), piece);
      return text;
    }
    case 4: {  // a digit
      for (int tries = 0; tries < 1000; ++tries)
        if (auto& c = text[below(text.size())]; std::isdigit(static_cast<unsigned char>(c)) != 0) {
          c = static_cast<char>('0' + (c - '0' + 1 + static_cast<int>(below(9))) % 10);
          break;
        }
      return text;
    }
    case 5: {  // a line less
      const auto [at, length] = lines();
      return text.erase(at, length);
    }
    case 6: {  // a line twice
      const auto [at, length] = lines();
      return text.insert(at, text.substr(at, length));
    }
    case 7: {  // two lines exchanged
      const auto [at, length] = lines();
      const auto line = text.substr(at, length);
      text.erase(at, length);
      const auto starts = line_starts(text);
      return text.insert(starts[below(starts.size())], line);
    }
    default: {  // a decimal mark
      for (int tries = 0; tries < 1000; ++tries)
        if (auto& c = text[below(text.size())]; c == '.') {
          c = ',';
          break;
        }
      return text;
    }
  }
}

std::multiset<std::string> told(const std::vector<Imported>& tables) {
  std::multiset<std::string> out;
  for (const auto& table : tables)
    for (const auto& f : table.findings)
      if (f.kind == "warning" || f.kind == "gap") out.insert(f.message);
  return out;
}

// One row less at either end is not for anybody to see, and hardly matters.
bool lacks_an_end(const recordings::Recording& whole, const recordings::Recording& part) {
  if (part.size() + 1 != whole.size()) return false;
  return std::equal(part.time.begin(), part.time.end(), whole.time.begin()) ||
         std::equal(part.time.begin(), part.time.end(), whole.time.begin() + 1);
}

// Of the samples, over the range of each channel; more than any if there are others.
double difference(const std::vector<Imported>& a, const std::vector<Imported>& b) {
  if (a.size() != b.size()) return INFINITY;
  double out = 0;
  for (std::size_t t = 0; t < a.size(); ++t) {
    const auto& x = a[t].recording;
    const auto& y = b[t].recording;
    if (lacks_an_end(x, y)) {
      out = std::max(out, 1e-3);
      continue;
    }
    if (x.size() != y.size()) return INFINITY;
    const auto compare = [&](const std::vector<double>& u, const std::vector<double>& v) {
      double low = INFINITY, high = -INFINITY, most = 0;
      for (std::size_t i = 0; i < u.size(); ++i) {
        if (std::isfinite(u[i])) low = std::min(low, u[i]), high = std::max(high, u[i]);
        if (std::isfinite(u[i]) != std::isfinite(v[i])) most = INFINITY;
        if (u[i] != v[i]) most = std::max(most, std::abs(u[i] - v[i]));
      }
      // What hardly varies at all is looked at by its size.
      const double range = std::max({high - low, 0.02 * std::max(std::abs(low), std::abs(high)), 1e-300});
      if (most > 0) out = std::max(out, most / range);
    };
    compare(x.time, y.time);
    for (const auto channel : recordings::all_channels) {
      if (x.has(channel) != y.has(channel)) return INFINITY;
      if (x.has(channel)) compare(x.at(channel), y.at(channel));
    }
  }
  return out;
}

bool says_where(const Error& error) {
  return std::ranges::any_of(error.problems(), [](const Problem& p) {
    return !p.path.empty() || p.message.find("line ") != std::string::npos ||
           p.message.find("the header of") != std::string::npos;
  });
}

class Judge {
 public:
  Judge(const NamedFile& file, DamageFigures& figures) : file_(file), figures_(figures) {
    figures_.rows.push_back({.file = file.name});
    sound_ = recordings::import_tables(given_for(file.text), std::nullopt);
    told_ = told(sound_);
  }

  void judge(const std::string& bytes, const fs::path& copy) {
    std::ofstream(copy, std::ios::binary) << bytes;
    auto& row = figures_.rows.back();
    ++row.copies;
    bool keep = true;
    alarm(patience);
    try {
      auto given = given_for(file_.text);
      given.csv = bytes;
      const auto tables = recordings::import_tables(given, std::nullopt);
      const auto now = told(tables);
      const double by = difference(sound_, tables);
      constexpr double small = 0.02;
      const bool more =
          std::ranges::any_of(now, [&](const auto& m) { return now.count(m) > told_.count(m); });
      keep = by > small && !more;
      if (by == 0)
        ++row.same;
      else if (more)
        ++row.stated;
      else if (by <= small)
        ++row.small;
      else
        ++row.silent, figures_.silent.push_back(copy.string());
    } catch (const Error& error) {
      keep = !says_where(error);
      ++row.refused;
      if (keep) figures_.failures.push_back(copy.string() + ": says no place: " + error.what());
    } catch (const std::exception& error) {
      figures_.failures.push_back(copy.string() + ": " + error.what());
    }
    alarm(0);
    if (!keep) fs::remove(copy);
  }

 private:
  const NamedFile& file_;
  DamageFigures& figures_;
  std::vector<Imported> sound_;
  std::multiset<std::string> told_;
};

}  // namespace

DamageFigures::Row DamageFigures::sum() const {
  Row out{.file = "all"};
  for (const auto& row : rows) {
    out.copies += row.copies, out.refused += row.refused, out.same += row.same;
    out.stated += row.stated, out.small += row.small, out.silent += row.silent;
  }
  return out;
}

std::ostream& operator<<(std::ostream& out, const DamageFigures& figures) {
  out << "file | copies | refused | samples as they were | stated | below 2 % | silent\n";
  auto rows = figures.rows;
  rows.push_back(figures.sum());
  for (const auto& r : rows)
    out << r.file << " | " << r.copies << " | " << r.refused << " | " << r.same << " | " << r.stated << " | "
        << r.small << " | " << r.silent << '\n';
  for (const auto& each : figures.failures) out << "FAILED " << each << '\n';
  for (const auto& each : figures.silent) out << "silent " << each << '\n';
  return out;
}

DamageFigures damage_tables(const std::vector<NamedFile>& files, int copies, std::uint64_t seed,
                            const fs::path& folder) {
  fs::create_directories(folder);
  DamageFigures out;
  Random random(seed);
  for (std::size_t f = 0; f < files.size(); ++f) {
    Judge judge(files[f], out);
    const auto count = static_cast<int>(files.size());
    for (int k = static_cast<int>(f); k < copies; k += count)
      judge.judge(damaged(files[f].text, random), folder / (std::to_string(k) + "-" + files[f].name));
  }
  return out;
}

}  // namespace ferrobench::imports
