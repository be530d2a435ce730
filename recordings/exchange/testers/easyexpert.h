// CSV exports of Keysight EasyEXPERT, as a B1500 with a WGFMU writes them.
//
//     SetupTitle, PUND                             header lines of one record: a word, then values
//     TestParameter, Name, ..., OperationMode1
//     TestParameter, Value, ..., Fast IV Vmeas
//     Dimension1, 1000, 1000                       rows
//     DataName, MeasResult1_value, ...             columns
//     DataValue, 0.038, ...                        rows
//
// Another record may follow. Some programs keep no more than the DataValue rows.
#pragma once

#include <string_view>
#include <vector>

#include "recordings/exchange/testers/tester_table.h"

namespace ferrobench::recordings {

struct EasyExpertRecord {
  std::vector<HeaderLine> header{};
  std::string_view rows{};  // from DataName, or else the first DataValue, to the last DataValue
  std::size_t first_line = 0;
  bool named = false;
  // By the operation modes of the channels, those of the record before where this one says none. Each channel
  // has one mode, so the current is that of another one than the voltage.
  std::string time{}, voltage{}, current{};
  Findings findings{};
};

bool looks_like_easyexpert(std::string_view text);   // with its header
bool looks_like_data_values(std::string_view text);  // nothing but rows
std::vector<EasyExpertRecord> read_easyexpert(std::string_view text);

}  // namespace ferrobench::recordings
