// One of each kind of message that carries something.
#pragma once

#include <string>
#include <vector>

#include "server/bench/messages.h"

namespace ferrobench::bench {

inline Prepare prepare() {
  protocols::Piece ramp{.kind = protocols::PieceKind::ramp, .duration = 0.5, .to = 1e6, .sampling = 200};
  ramp.recorded = {.rate = 400, .per_decade = 30};
  protocols::Piece samples{
      .kind = protocols::PieceKind::samples, .start = 0.5, .duration = 1, .from = 1e6, .to = -1.25};
  samples.levels = std::make_shared<std::vector<double>>(std::vector{1e6, 0.5e6, -1.25});
  return {
      .call = 7,
      .run = 2,
      .device = 3,
      .last_use = true,
      .real_time = true,
      .rate = 1234.5,
      .limits = {.field_max = 1.5e6, .stop_slew = 3e5},
      .program = {{ramp, samples}, {{.kind = "ramp", .label = "up"}, {.kind = "ramp"}}, {"kV/mm", 1e6, 1}}};
}

inline daq::DeviceFacts facts() {
  return {.info = {{"driver", "usb"}, {"serial_number", "01"}},
          .columns = {{recordings::Channel::field, 2, 3}, {recordings::Channel::force, 1, 0}},
          .signals = {recordings::Channel::charge},
          .noise = {std::nullopt, 1.5, {}, {}, 0.25},
          .model = nullptr,
          .output_range = {-2e6, 2e6},
          .specimen = recordings::Specimen{.name = "stack", .length = 0.018, .layer_count = 180},
          .load = {1e6, 2e6},
          .past = {.kind = protocols::PastKind::visited,
                   .from = protocols::FirstState::partly_poled,
                   .levels = {{1e6, 2}},
                   .poling = 0.25},
          .output = -0.5};
}

inline std::vector<std::string> frames() {
  const Reply refused{.call = 9,
                      .failure = Failure::of(Error(ErrorCode::limit_exceeded, "too far",
                                                   Problem{.path = "/segments/1", .given = 2e6}))};
  const Closed closed{.run = 2,
                      .state = {.guard = daq::Progress::State::ended, .end = daq::End::limit, .rows = 12},
                      .ending = "{}",
                      .played = {{.start_sample = 0, .end_sample = 12, .kind = "ramp", .label = {}}}};
  return {framed(Open{.call = 1, .device = 3, .driver = "usb", .config = {{"update_rate", 2000}}}),
          framed(prepare()),
          framed(Begin{.run = 2, .path = "a.h5.journal", .events = {{0.5, "note", "x"}}, .unattended = true}),
          framed(Stop{.call = 4, .run = 2, .reason = "enough"}),
          framed(Ready{.process = 4711, .lacks = "a", .run = 2, .card = "{}"}),
          framed(Reply{.call = 1, .body = encoded(facts())}),
          framed(refused),
          framed(Status{.run = 2, .state = {.rows = 5, .reason = "r"}}),
          framed(Noted{.run = 2, .missed = 1, .event = {1, "gap", "2 rows"}}),
          framed(closed)};
}

}  // namespace ferrobench::bench
