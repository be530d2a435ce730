// Files as testers write them, of a specimen that a formula makes: layouts and nothing else are theirs.
#pragma once

#include <string>
#include <vector>

namespace ferrobench::imports {

// A film of 0.01 mm^2 and 200 nm, or a ceramic of 50 mm^2 and 1 mm.
struct Layout {
  double offset = 0;           // V, of the measured voltage
  double area_in_header = 1;   // times the true one
  bool decimal_comma = false;  // as a spreadsheet leaves it
  int layers = 1;              // in the header
};

std::string aixacct_piezo(int tables, const Layout& layout = {});
std::string aixacct_hysteresis(int tables, const Layout& layout = {});
std::string aixacct_pulses(const Layout& layout = {});
std::string aixacct_leakage();
std::string aixacct_fatigue();
std::string radiant_hysteresis();  // in code page 1252
std::string radiant_remanent();    // in UTF-8
std::string radiant_leakage();
std::string easyexpert();   // two records of the same rows
std::string data_values();  // time, current, voltage, time, time

struct NamedFile {
  std::string name, text;
};
// One of each.
std::vector<NamedFile> all_files();

}  // namespace ferrobench::imports
