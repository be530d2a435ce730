// What may be written can be read: the numbers of a recording's header at the ends of every range in which a
// model, a protocol, a device's configuration or an import may give them.
#include <map>
#include <set>

#include "daq/usb/config.h"
#include "engine_bench.h"
#include "model/model_fields.h"
#include "protocols/program.h"
#include "recordings/exchange/import_csv.h"
#include "recordings/file/reader.h"
#include "recordings/file/writer.h"

namespace ferrobench::server {
namespace {

constexpr double most_whole = 9e15;  // of a whole number in JSON

// The ends of the ranges by the field's name without its unit.
struct Ends {
  std::map<std::string, std::set<double>, std::less<>> of;

  template <class T>
  void operator()(std::string_view name, T&, const FieldInfo& info) {
    for (const std::string_view known :
         {"length", "area", "layer_thickness", "layer_count", "spring_stiffness", "prestress", "poling",
          "field_V_per_m", "seconds"}) {
      if (name != known && !name.starts_with(std::string(known) + "_")) continue;
      const double largest = known == "layer_count" ? most_whole : std::numeric_limits<double>::max();
      const double low = std::max(info.min, -largest);
      of[std::string(known)].insert(
          {info.exclusive_min ? std::nextafter(low, largest) : low, std::min(info.max, largest)});
    }
  }
  template <class Struct>
  void add() {
    Struct fields;
    describe(*this, fields);
  }
};

Ends all_ends() {
  Ends ends;
  ends.add<model::Actuator>();
  ends.add<model::Load>();
  ends.add<protocols::LoadFields>();
  ends.add<protocols::Past>();
  ends.add<protocols::VisitedLevel>();
  ends.add<daq::usb::SpecimenConfig>();
  ends.add<daq::usb::LoadConfig>();
  ends.add<recordings::CsvImport>();
  return ends;
}

TEST(HeaderRange, WhatMayBeWrittenCanBeRead) {
  using protocols::FirstState;
  using protocols::PastKind;
  const Folder folder;
  const auto path = (folder.path / "ends.h5").string();
  recordings::Recording written;
  written.time = {0, 1};
  written.set(recordings::Channel::field) = {0, 0};
  auto& h = written.header;
  const auto ends = all_ends();
  ASSERT_EQ(ends.of.size(), 9u);
  for (const auto& [name, values] : ends.of)
    for (const double value : values) {
      h.specimen = {"stack", 0.01, 1e-4, 1e-4, 100};
      h.load = {};
      h.past = {.kind = PastKind::visited, .from = FirstState::partly_poled, .levels = {{0, 1}}, .poling = 0};
      const std::map<std::string_view, double*> places{{"length", &h.specimen.length},
                                                       {"area", &h.specimen.area},
                                                       {"layer_thickness", &h.specimen.layer_thickness},
                                                       {"spring_stiffness", &h.load.spring_stiffness},
                                                       {"prestress", &h.load.prestress},
                                                       {"poling", &*h.past.poling},
                                                       {"field_V_per_m", &h.past.levels[0].field},
                                                       {"seconds", &h.past.levels[0].seconds}};
      if (const auto place = places.find(name); place != places.end())
        *place->second = value;
      else
        h.specimen.layer_count = static_cast<std::int64_t>(value);
      write_recording(path, written, recordings::Existing::replace);
      try {
        const auto read = recordings::read_recording(path).header;
        EXPECT_EQ(to_json(read.specimen), to_json(h.specimen)) << name << " " << value;
        EXPECT_EQ(to_json(read.load), to_json(h.load)) << name << " " << value;
        EXPECT_EQ(read.past, h.past) << name << " " << value;
      } catch (const Error& error) {
        ADD_FAILURE() << name << " " << value << ": " << error.problems().at(0).message;
      }
    }
}

TEST(HeaderRange, OfAPrestressIsOneWhereverItIsGiven) {
  EXPECT_EQ(all_ends().of.at("prestress"), (std::set<double>{prestress_min, prestress_max}));
}

TEST_F(EngineTest, ARunUnderTensionIsRead) {
  auto asked = request(trapezium(0.1, 0.1), true);
  asked.set = {{"prestress_MPa", -1}};
  const auto status = finish(asked);
  ASSERT_EQ(status.state, RunState::complete) << status.reason;
  EXPECT_EQ(recordings::read_recording(status.path).header.load.prestress, -1e6);
}

}  // namespace
}  // namespace ferrobench::server
