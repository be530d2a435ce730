// What each message consists of (codec.h).
#pragma once

#include "server/bench/messages.h"

namespace ferrobench::bench {

template <>
inline constexpr auto last_of<protocols::PieceKind> = protocols::PieceKind::samples;
template <>
inline constexpr auto last_of<protocols::PastKind> = protocols::PastKind::partly_poled;
template <>
inline constexpr auto last_of<protocols::FirstState> = protocols::FirstState::partly_poled;
template <>
inline constexpr auto last_of<recordings::Channel> = recordings::Channel::force;
template <>
inline constexpr auto last_of<daq::Progress::State> = daq::Progress::State::ended;
template <>
inline constexpr auto last_of<daq::End> = daq::End::fault;
template <>
inline constexpr auto last_of<ErrorCode> = ErrorCode::internal;

#define FERROBENCH_FIELDS(Type, ...)                   \
  template <class V>                                   \
  void fields(V& v, typename V::template Of<Type> m) { \
    v(__VA_ARGS__);                                    \
  }
FERROBENCH_FIELDS(protocols::Recorded, m.rate, m.per_decade)
FERROBENCH_FIELDS(protocols::Piece, m.kind, m.start, m.duration, m.from, m.to, m.center, m.amplitude,
                  m.frequency, m.phase, m.sampling, m.recorded, m.levels)
FERROBENCH_FIELDS(protocols::Segment, m.kind, m.label, m.start, m.end, m.level, m.rate, m.path)
FERROBENCH_FIELDS(protocols::LevelUnit, m.name, m.unit, m.divisor)
FERROBENCH_FIELDS(protocols::VisitedLevel, m.field, m.seconds)
FERROBENCH_FIELDS(protocols::Past, m.kind, m.from, m.levels, m.poling)
FERROBENCH_FIELDS(recordings::RawColumn, m.channel, m.gain, m.offset)
FERROBENCH_FIELDS(recordings::Event, m.time, m.kind, m.message)
FERROBENCH_FIELDS(recordings::SegmentRow, m.start_sample, m.end_sample, m.kind, m.label, m.level, m.rate)
FERROBENCH_FIELDS(recordings::Specimen, m.name, m.length, m.area, m.layer_thickness, m.layer_count)
FERROBENCH_FIELDS(recordings::LoadCase, m.spring_stiffness, m.prestress)
FERROBENCH_FIELDS(daq::OutputRange, m.min, m.max)
FERROBENCH_FIELDS(daq::Limits, m.field_min, m.field_max, m.slew, m.stop_slew, m.stop_time,
                  m.reverse_field_threshold, m.reverse_field_time, m.displacement_min, m.displacement_max,
                  m.force_min, m.force_max, m.monitor_margin)
FERROBENCH_FIELDS(daq::DeviceFacts, m.info, m.columns, m.signals, m.noise, m.model, m.output_range,
                  m.specimen, m.load, m.past, m.output)

FERROBENCH_FIELDS(daq::SelftestRow, m.quantity, m.measured, m.lowest, m.highest, m.unit, m.passed)
FERROBENCH_FIELDS(daq::SelftestReport, m.passed, m.sample_rate, m.rows)

FERROBENCH_FIELDS(Open, m.call, m.device, m.driver, m.config)
FERROBENCH_FIELDS(Look, m.call, m.device)
FERROBENCH_FIELDS(Close, m.call, m.device, m.slew)
FERROBENCH_FIELDS(Selftest, m.call, m.device, m.rate)
FERROBENCH_FIELDS(StopSelftest, m.reason)
FERROBENCH_FIELDS(Program, m.pieces, m.segments, m.unit)
FERROBENCH_FIELDS(Prepare, m.call, m.run, m.device, m.last_use, m.real_time, m.rate, m.exact_rate, m.limits,
                  m.program)
FERROBENCH_FIELDS(Prepared, m.rate, m.distortion, m.size, m.first_level, m.stop_slew, m.facts)
FERROBENCH_FIELDS(Begin, m.run, m.path, m.start_time, m.events, m.unattended, m.folder, m.card)
FERROBENCH_FIELDS(Attend, m.run)
FERROBENCH_FIELDS(Drop, m.run)
FERROBENCH_FIELDS(Pause, m.call, m.run)
FERROBENCH_FIELDS(Resume, m.call, m.run)
FERROBENCH_FIELDS(Stop, m.call, m.run, m.reason)
FERROBENCH_FIELDS(Hasten, m.call, m.run)
FERROBENCH_FIELDS(Ready, m.process, m.lacks, m.run, m.card)
FERROBENCH_FIELDS(Failure, m.code, m.message, m.problems)
FERROBENCH_FIELDS(Reply, m.call, m.failure, m.body)
FERROBENCH_FIELDS(RunState, m.guard, m.end, m.output_at_zero, m.rows, m.rows_expected, m.rows_on_disk,
                  m.blocks_waiting, m.most_waiting, m.reason, m.warning)
FERROBENCH_FIELDS(Status, m.run, m.state)
FERROBENCH_FIELDS(Noted, m.run, m.missed, m.event)
FERROBENCH_FIELDS(Closed, m.run, m.state, m.ending, m.failure, m.rows, m.played)
#undef FERROBENCH_FIELDS

template <class V>
void fields(V&, typename V::template Of<Leave>) {}
template <class V>
void fields(V&, typename V::template Of<Alive>) {}

}  // namespace ferrobench::bench
