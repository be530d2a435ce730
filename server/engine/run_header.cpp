#include "server/engine/run_header.h"

#include <boost/uuid/random_generator.hpp>
#include <boost/uuid/uuid_io.hpp>
#include <cmath>

#include "daq/replay/replay_source.h"
#include "model/model.h"
#include "recordings/format/iso_time.h"

namespace ferrobench::server {

namespace {

// The past with the way to the program's first level, which is not recorded. Towards + it matters, too: under
// a prestress a specimen that is poled so has domains at 90 degrees at no field, and they come back on the
// way.
protocols::Past on_to(protocols::Past past, double from, double level, double slew) {
  if (!past.known() || level == from) return past;
  if (!std::isfinite(from) || !(slew > 0)) return {};
  const protocols::VisitedLevel first{level, std::abs(level - from) / slew};
  return protocols::and_then(std::move(past), {&first, 1});
}

recordings::Header measured_header(const RunSetup& setup, const daq::DeviceFacts& device) {
  recordings::Header header;
  header.title = setup.plan.protocol.title();
  header.protocol = setup.plan.protocol.json();
  header.model = device.model;
  // What the device knows of the specimen, else what the program's author says.
  header.past = device.past;
  if (!header.past.known()) header.past = setup.plan.protocol.past().value_or(protocols::Past{});
  if (header.model.is_null()) {
    header.specimen = device.specimen.value_or(recordings::Specimen{});
    header.load = device.load;
    return header;
  }
  const auto model = model::model_from_json(header.model);
  const auto& a = model.actuator;
  header.specimen = {model.name, a.length, a.area, a.layer_thickness, a.layer_count};
  header.load = {model.load.spring_stiffness, model.load.prestress};
  return header;
}

}  // namespace

recordings::Header header_of(const RunSetup& setup, const bench::Prepared& prepared) {
  const auto* replay = setup.device->replay();
  const auto& device = prepared.facts;
  auto header = replay != nullptr ? replay->header() : measured_header(setup, device);
  if (replay == nullptr)
    header.past = on_to(std::move(header.past), device.output, prepared.first_level, prepared.stop_slew);
  header.start_time = recordings::iso_now();
  header.entry_identifier =
      setup.identifier.empty() ? to_string(boost::uuids::random_generator()()) : setup.identifier;
  header.device = device.info;
  header.device["sample_rate_asked"] = setup.plan.sample_rate;
  header.device["sample_rate"] = prepared.rate;
  if (!setup.rerun_of.empty()) header.device["rerun_of"] = setup.rerun_of;
  if (header.device.contains("seed")) header.run_seed = header.device["seed"].get<std::int64_t>();
  return header;
}

}  // namespace ferrobench::server
