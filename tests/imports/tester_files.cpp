#include "tests/imports/tester_files.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <numbers>

namespace ferrobench::imports {
namespace {

constexpr int points = 200;  // of a loop

std::string number(double value) {
  std::array<char, 40> text{};
  static_cast<void>(std::snprintf(text.data(), text.size(), "%.6e", value));
  return text.data();
}

struct Loop {
  std::vector<double> t, v, i, p;  // s, V, A, C/m^2
};

// A branch of tanh with a coercive voltage of 40 % of the amplitude; P is the integral of I/A by trapezoids.
Loop loop(double amplitude, double period, double area, double start = 0.25, double offset = 0) {
  Loop out;
  const auto triangle = [](double x) { return x < 0.25 ? 4 * x : x < 0.75 ? 2 - 4 * x : 4 * x - 4; };
  double p = -start, charge_before = -start;
  for (int k = 0; k <= points; ++k) {
    const double x = static_cast<double>(k) / points, v = amplitude * triangle(x);
    const bool rising = x < 0.25 || x >= 0.75;
    const double at = std::tanh((v / amplitude + (rising ? -0.4 : 0.4)) / 0.15);
    const double charge = start * at + 0.05 * v / amplitude;
    if (k == 0) charge_before = charge;
    out.t.push_back(x * period);
    out.v.push_back(v + offset);
    out.i.push_back(area * (charge - charge_before) / (period / points));
    charge_before = charge;
    if (k > 0) p += 0.5 * (out.i[out.i.size() - 1] + out.i[out.i.size() - 2]) * (period / points) / area;
    out.p.push_back(p);
  }
  return out;
}

std::string with_commas(std::string text, bool commas) {
  if (!commas) return text;
  for (std::size_t k = 1; k + 1 < text.size(); ++k)
    if (text[k] == '.' && std::isdigit(text[k - 1]) != 0 && std::isdigit(text[k + 1]) != 0) text[k] = ',';
  return text;
}

std::string row(const std::vector<double>& cells) {
  std::string out;
  for (const double cell : cells) out += number(cell) + "\t";
  return out + "\n";
}

struct Specimen {
  double area, thickness;  // m^2, m
};
constexpr Specimen film{1e-8, 200e-9}, ceramic{50e-6, 1e-3};

std::string table_header(const Specimen& s, const Layout& layout, double amplitude, double frequency) {
  const double vacuum = 8.8541878128e-12, capacitance = 1000 * vacuum * s.area / s.thickness;
  return "Timestamp: 01/02/2026 10:11:12\nTableVersion: 4.5.0\nAverages: 1\nWaveform: triangle\n"
         "SampleName: made up\nArea [mm2]: " +
         number(s.area * 1e6 * layout.area_in_header) + "\nThickness [nm]: " + number(s.thickness * 1e9) +
         "\nNumber Of Ceramic Layers: " + std::to_string(layout.layers) +
         "\nHysteresis Frequency [Hz]: " + number(frequency) +
         "\nHysteresis Amplitude [V]: " + number(amplitude) + "\nCls [F]: " + number(capacitance) +
         "\nEpsls [1]: " + number(1000) + "\n";
}

std::string summary(const std::string& name, int tables) {
  std::string out = name + "Result\n\nTable 1\nTable No [#]\tVc+ [V]\tPr+ [uC/cm2]\t\n";
  for (int k = 1; k <= tables; ++k) out += row({static_cast<double>(k), 1.5, 25});
  return out + "\n" + name +
         "\nProgram: made up\nTimeStamp: 01/02/2026 10:11:12\nTfaModule: PZM\nTfaVersion: 4.11.0\n\n";
}

}  // namespace

std::string aixacct_piezo(int tables, const Layout& layout) {
  auto out = summary("Piezo", tables);
  for (int k = 1; k <= tables; ++k) {
    const double amplitude = 800 + 100 * k, period = 10.0 / k;
    const auto l = loop(amplitude, period, ceramic.area, 0.25, layout.offset);
    out += "Table " + std::to_string(k) + "\n" + table_header(ceramic, layout, amplitude, 1 / period) +
           "SingleLoop: YES\n" +
           (k == 2 ? "Error: underflow\nMeasurement Status: 2\n" : "Measurement Status: 0\n") +
           "Time [s]\tV+ [V]\tV- [V]\tI1 [A]\tP1 [uC/cm2]\tI2 [A]\tP2 [uC/cm2]\tI3 [A]\tP3 [uC/cm2]\tD1 "
           "[nm]\tD2 "
           "[nm]\tD3 [nm]\tCH3 [V]\t\n";
    for (std::size_t i = 0; i < l.t.size(); ++i) {
      const double p = 100 * l.p[i], d = 3000 * (l.p[i] * l.p[i] - l.p[0] * l.p[0]) / 0.0625;
      out += row({l.t[i], l.v[i], 0, l.i[i], p, l.i[i], p, 0, -16, d, d, 0, 0});
    }
    out += "\n";
  }
  return with_commas(out, layout.decimal_comma);
}

std::string aixacct_hysteresis(int tables, const Layout& layout) {
  auto out = summary("DynamicHysteresis", tables);
  for (int k = 1; k <= tables; ++k) {
    const auto up = loop(5, 0.01 / k, film.area), down = loop(-5, 0.01 / k, film.area, -0.25);
    out += "Table " + std::to_string(k) + "\n" + table_header(film, layout, 5, 100 * k) +
           "Basic System: TFAnalyzer \xa9\nMeasurement Status: 0\n"
           "Time [s]\tV+ [V]\tV- [V]\tI1 [A]\tP1 [uC/cm2]\tI2 [A]\tP2 [uC/cm2]\tI3 [A]\tP3 [uC/cm2]\t\n";
    const auto half = static_cast<std::size_t>(points) / 2;
    double joined = -0.245;
    for (std::size_t i = 0; i < up.t.size(); ++i) {
      const double i2 = i < half ? 0.98 * up.i[i] : up.i[i];
      if (i > 0)
        joined += 0.5 * (i2 + (i <= half ? 0.98 : 1) * up.i[i - 1]) * (up.t[1] - up.t[0]) / film.area;
      out += row({up.t[i], up.v[i], down.v[i], up.i[i], 100 * up.p[i], i2, 100 * joined, down.i[i],
                  100 * down.p[i]});
    }
    out += "\n";
  }
  return with_commas(out, layout.decimal_comma);
}

std::string aixacct_pulses(const Layout& layout) {
  auto out = summary("Pulse", 1);
  out +=
      "Table 1\nNumber of pulses: 5\nPulse Sequence: 0XUNDP-\nPulse Points: 201\nSampleName: made up\nArea "
      "[mm2]: " +
      number(film.area * 1e6 * layout.area_in_header) +
      "\nThickness [nm]: 200\nNumber Of Ceramic Layers: " + std::to_string(layout.layers) +
      "\nPund Frequency [Hz]: 100\nPund Amplitude [V]: 8\nMeasurement Status: 0\n";
  for (int g = 0; g < 5; ++g) out += "Time [s]\tV [V]\tI [A]\tP [uC/cm2]\t";
  out += "\n";
  std::array<double, 5> p{-10, 8, 8, -9, -9}, before{};
  const std::array<double, 5> sign{1, 1, -1, -1, 1};
  for (int i = 0; i <= points; ++i) {
    std::vector<double> cells;
    for (std::size_t g = 0; g < 5; ++g) {
      const double x = static_cast<double>(i) / points, v = 8 * sign[g] * std::sin(std::numbers::pi * x);
      const double current = (g % 2 == 0 ? 2e-7 : 1e-7) * sign[g] * std::cos(std::numbers::pi * x) +
                             (g % 2 == 0 ? 3e-7 * sign[g] * std::exp(-100 * (x - 0.3) * (x - 0.3)) : 0);
      if (i > 0) p[g] += 100 * 0.5 * (current + before[g]) * (0.01 / points) / film.area;
      before[g] = current;
      cells.insert(cells.end(), {1.0 * static_cast<double>(g) + 0.01 * x, v, current, p[g]});
    }
    out += row(cells);
  }
  return with_commas(out, layout.decimal_comma);
}

std::string aixacct_leakage() {
  auto out = summary("Leakage", 1) +
             "Table 1\nSampleName: made up\nArea [mm2]: 0.01\nThickness [nm]: 200\nNumber Of Ceramic Layers: "
             "1\nStep "
             "Duration [s]: 2\nMax. Voltage [V]: 4.5\nVoltage Step [V]: 0.5\nMeasurement Status: 0\nVoltage "
             "[V]\tLeakage Current Density "
             "[uA/cm2]\tMedian Current Density [uA/cm2]\t\n";
  for (int k = 0; k <= 36; ++k) {
    const double v = 0.5 * (k <= 9 ? k : k <= 27 ? 18 - k : k - 36);
    out += row({v, 0.02 * std::sinh(v), 0.019 * std::sinh(v)});
  }
  return out;
}

std::string aixacct_fatigue() {
  std::string out =
      "Fatigue\nProgram: made up\nTimeStamp: 01/02/2026 10:11:12\n\nResult Table 1\nSampleName: made up\n"
      "Area [mm2]: 0.01\nThickness [nm]: 200\nNumber Of Ceramic Layers: 1\nFatigue Amplitude [V]: "
      "4.5\nFatigue "
      "Frequency [Hz]: 1000\nTotal Cycles: 10000\nCycles [n]\tMeasurement Status [1]\t1-DHM Pr+ "
      "[uC/cm2]\t1-DHM Pr- "
      "[uC/cm2]\t\n";
  for (const double n : {0.1, 10000.0, 1.0, 100.0})
    out += row({n, 0, 20 - std::log10(n), std::log10(n) - 20});
  out += "\nData Measurement Parameters\n1-DHM (1..4) Hysteresis Frequency [Hz]: 100\n\n";
  const auto tables = aixacct_hysteresis(2, {});
  auto rest = tables.substr(tables.find("Table 1\nTimestamp"));
  for (int k = 1; k <= 2; ++k) {
    const auto name = "Table " + std::to_string(k) + "\nTimestamp";
    const auto at = rest.find(name);
    rest.replace(at, name.size(), "Data Table [1," + std::to_string(k) + "]\nTotal Cycles: 0.1\nTimestamp");
  }
  return out + rest;
}

namespace {

std::string radiant_head(const std::string& task, const std::string& open, const std::string& close,
                         const std::string& micro) {
  const auto title = [&](const std::string& text) {
    std::string out;
    for (int k = 0; k < 20; ++k) out += open;
    out += " " + text + " ";
    for (int k = 0; k < 20; ++k) out += close;
    return out + "\n";
  };
  return title(task) + open + open + "  Executed Version:\t5.26.1\n\nStored:\t1/2/2026 - 10:11:12\n\n" +
         title("Sample Info") + "Sample Name:\tmade up\nSample Area (cm2):\t1.00e-04\nSample Thickness (" +
         micro + "m):\t2.00e-01\n\n" + title(task + " Info") +
         "Task Name:\tmade up\nVolts:\t9.00\nField:\t450.00 (kV/cm)\nHysteresis Period (ms):\t1.00e+01\n\n" +
         title("Data") + "Points:\t201\n\n";
}

std::string tabbed(int point, std::initializer_list<double> cells) {
  std::array<char, 16> first{};
  static_cast<void>(std::snprintf(first.data(), first.size(), "%4d", point));
  std::string out = first.data();
  for (const double cell : cells) out += "\t" + number(cell);
  return out + "\n";
}

}  // namespace

std::string radiant_hysteresis() {
  auto out = radiant_head("Hysteresis", "\xbb", "\xab", "\xb5") +
             "Valid Data\n\nPoint\tTime (ms)\tDrive Voltage\tMeasured Polarization\n";
  const auto l = loop(9, 0.01, film.area);
  for (std::size_t i = 0; i < l.t.size(); ++i)
    out += tabbed(static_cast<int>(i) + 1, {1e3 * l.t[i] + 0.02, l.v[i], 100 * l.p[i]});
  return out +
         "\nPMax (\xb5"
         "C/cm2):\t" +
         number(100 * std::ranges::max(l.p)) +
         "\nC (Max-Eff) (nF):\t4.427e-01\nK (Eff):\t1.00e+03\n\nHysteresis Version: 5.26.1\n";
}

std::string radiant_remanent() {
  auto out = radiant_head("Remanent Hysteresis", "\xc2\xbb", "\xc2\xab", "\xc2\xb5") +
             "Logic 0 - Valid DataLogic 1 - Valid DataPoint\tTime (ms)\tDrive Voltage\tLogic 0 "
             "Polarization\tLogic 1 "
             "Polarization\tRemanent Polarization\n";
  const auto l = loop(9, 0.01, film.area);
  for (std::size_t i = 0; i < l.t.size(); ++i)
    out += tabbed(static_cast<int>(i) + 1,
                  {1e3 * l.t[i] + 0.02, l.v[i], 0.5 * l.v[i], 100 * l.p[i], 100 * l.p[i] - 0.5 * l.v[i]});
  return out + "\n\nRemanent Hysteresis Version: 5.26.2\n";
}

std::string radiant_leakage() {
  auto out = radiant_head("Leakage", "\xbb", "\xab", "\xb5") +
             "## - Valid DataPoint\tTime (ms)\tVolts\tMeasured Current (Amps)\n";
  for (int k = 1; k <= 201; ++k) out += tabbed(k, {20.0 * k, 9 + 1e-4 * (k % 3), 1e-11 + 1e-9 / k});
  return out +
         "\nCurrent (Amps):\t1.497e-11\nResistance (Ohms):\t6.000e+11\nResistivity (Ohms\xb7"
         "cm):\t3.000e+12\n";
}

std::string easyexpert() {
  std::string rows =
      "Dimension1, 201, 201, 201, 201\nDimension2, 1, 1, 1, 1\nDataName, MeasResult1_value, "
      "MeasResult2_value, MeasResult1_time, MeasResult2_time\n";
  const auto l = loop(3, 1e-4, film.area);
  for (std::size_t i = 0; i < l.t.size(); ++i)
    rows += "DataValue, " + number(l.v[i]) + ", " + number(-l.i[i]) + ", " + number(l.t[i]) + ", " +
            number(l.t[i]) + "\n";
  return "\xef\xbb\xbf\nSetupTitle, made up\nApplicationTest, WGFMU Pattern Editor, Public\nTestParameter, "
         "Name, "
         "Channel1, OperationMode1, Channel2, OperationMode2\nTestParameter, Value, WGFMU1:RS\tRSWGFMU, Fast "
         "IV Vmeas, "
         "WGFMU2:RS\tRSWGFMU, Fast IV Imeas\nMetaData, TestRecord.RecordTime, 01/02/2026 10:11:12\n" +
         rows +
         "SetupTitle, made up Child DataDisplay\nTestParameter, Name, NumOfDisplay\nTestParameter, Value, "
         "1\n" +
         rows;
}

std::string data_values() {
  std::string out;
  const auto l = loop(3, 1e-3, film.area);
  for (std::size_t i = 0; i < l.t.size(); ++i)
    out += "DataValue," + number(l.t[i]) + "," + number(l.i[i]) + "," + number(l.v[i]) + "," +
           number(l.t[i]) + "," + number(l.t[i]) + "\r\n";
  return out;
}

std::vector<NamedFile> all_files() {
  return {{"piezo.dat", aixacct_piezo(3, {.offset = 72})},
          {"hysteresis.dat", aixacct_hysteresis(2)},
          {"pulses.dat", aixacct_pulses()},
          {"leakage.dat", aixacct_leakage()},
          {"fatigue.dat", aixacct_fatigue()},
          {"hysteresis.txt", radiant_hysteresis()},
          {"remanent.txt", radiant_remanent()},
          {"leakage.txt", radiant_leakage()},
          {"forc.csv", easyexpert()},
          {"pund.csv", data_values()}};
}

}  // namespace ferrobench::imports
