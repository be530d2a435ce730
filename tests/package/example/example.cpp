// example FILE.h5: a shipped experiment played through a shipped model, kept as a recording, read again and
// reported.
#include <cstdio>
#include <exception>
#include <vector>

#include "model/simulator.h"
#include "protocols/protocol.h"
#include "recordings/file/reader.h"
#include "recordings/file/writer.h"
#include "recordings/reports/report.h"

int main(int argc, char** argv) {
  using namespace ferrobench;
  using recordings::Channel;
  if (argc != 2) return 2;
  try {
    const auto protocol = protocols::library_protocol("stage-full-range");
    const auto model = model::library_model("mcl-op30");
    const protocols::SampledWaveform program(
        protocol.expand({.layer_thickness = model.actuator.layer_thickness}), protocol.sample_rate().value());
    std::vector<double> time(program.size()), field(program.size());
    program.fill(0, field);
    for (std::size_t i = 0; i < time.size(); ++i) time[i] = static_cast<double>(i) / program.rate();
    auto played = model::simulate(model, time, field);

    recordings::Recording made;
    made.header.title = protocol.title();
    made.header.start_time = "2026-01-01T00:00:00Z";
    made.header.entry_identifier = "00000000-0000-4000-8000-000000000001";
    made.header.protocol = protocol.json();
    made.header.model = model::to_json(model);
    made.header.specimen = {model.name, model.actuator.length, model.actuator.area,
                            model.actuator.layer_thickness, model.actuator.layer_count};
    made.header.load = {model.load.spring_stiffness, model.load.prestress};
    made.time = time;
    made.set(Channel::command) = field;
    made.set(Channel::field) = std::move(played.field);
    made.set(Channel::charge) = std::move(played.charge);
    made.set(Channel::displacement) = std::move(played.displacement);
    made.set(Channel::force) = std::move(played.force);
    recordings::write_recording(argv[1], made);

    const auto read = recordings::read_recording(argv[1]);
    if (read.at(Channel::displacement) != made.at(Channel::displacement)) return 1;
    std::fputs(render(make_report(read), recordings::Format::text).c_str(), stdout);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
