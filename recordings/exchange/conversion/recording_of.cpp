#include "recordings/exchange/conversion/recording_of.h"

#include <algorithm>
#include <boost/uuid/random_generator.hpp>
#include <boost/uuid/uuid_io.hpp>
#include <cmath>

#include "base/error.h"
#include "base/number_text.h"
#include "recordings/analysis/segments.h"
#include "recordings/exchange/conversion/checks.h"
#include "recordings/exchange/conversion/sample_checks.h"
#include "recordings/exchange/conversion/units_of_columns.h"
#include "recordings/format/iso_time.h"

namespace ferrobench::recordings {
namespace {

void take_field(Measured& m, const Specimen& specimen) {
  if (!m.voltage || m.channel(Channel::field)) return;
  auto& field = m.channel(Channel::field).emplace(*m.voltage);
  for (double& e : field) e /= specimen.layer_thickness;
}

// By A P with the layers that the check has found, or by the integral of the current. What the user says of
// the specimen stays.
void take_charge(Measured& m, Specimen& specimen, const KnownSpecimen& given, nlohmann::json& device) {
  auto& charge = m.channel(Channel::charge);
  if (m.polarization) {
    const auto layers = check_polarization(m, specimen, given.layer_count.has_value());
    if (layers != specimen.layer_count && !given.layer_count) {
      if (!given.length)
        specimen.length *= static_cast<double>(layers) / static_cast<double>(specimen.layer_count);
      specimen.layer_count = layers;
    }
    if (charge) return;
    auto& q = charge.emplace(std::move(*m.polarization));
    const auto first = std::ranges::find_if(q, [](double p) { return std::isfinite(p); });
    const double zero = first == q.end() ? 0 : *first;
    for (double& v : q) v = m.area * static_cast<double>(layers) * (v - zero);
    device["polarization_at_first_sample_C_per_m2"] = zero;
    m.say("note", "the charge is A P, from the first sample on, where P is " + number_text(zero) +
                      " C/m^2 by the source's own zero" +
                      (m.area == specimen.area ? "" : "; A is the file's area, by which P was divided"));
  } else if (!charge && m.current && !m.conducts) {
    charge = integral(m.time, *m.current);
    m.say("note", "the charge is the integral of the current, from zero at the first sample");
  } else {
    check_charge(m);
  }
}

// An integral of a current with an offset drifts; so does what leaks.
void check_closure(Measured& m) {
  const auto& charge = m.channel(Channel::charge);
  if (!charge || !m.current || charge->empty() || !m.blocks.empty()) return;
  const double range = range_of(*charge).span();
  const double drift = charge->back() - charge->front(), duration = m.time.back() - m.time.front();
  constexpr double small = 0.01;
  if (!(range > 0) || !(std::abs(drift) > small * range)) return;
  m.say("note", "the charge ends " + number_text(100 * std::abs(drift) / range) + " % of its range " +
                    (drift > 0 ? "above" : "below") + " where it began; a constant " +
                    number_text(drift / duration) + " A in the current would do that");
}

void demand_program(const Measured& m) {
  if (m.channel(Channel::field) || m.channel(Channel::command)) return;
  throw Error(ErrorCode::bad_recording, "the table is not a recording",
              Problem{.path = "/field",
                      .message = "is missing: neither a field nor a voltage is among the columns",
                      .hint = "a recording needs the field, measured or asked for"});
}

void count_gaps(Measured& m) {
  std::size_t gaps = 0;
  for (const auto& channel : m.channels)
    if (channel)
      gaps +=
          static_cast<std::size_t>(std::ranges::count_if(*channel, [](double v) { return std::isnan(v); }));
  const bool told = std::ranges::any_of(m.findings, [](const Finding& f) { return f.kind == "gap"; });
  if (gaps > 0 && !told) m.say("gap", std::to_string(gaps) + " values are missing: gaps");
}

}  // namespace

Imported recording_of(Measured&& m, Specimen specimen, const Identity& identity, nlohmann::json device) {
  take_field(m, specimen);
  demand_program(m);
  demand_rising_time(m);
  check_spikes(m);
  check_voltage(m);
  check_duration(m);
  check_steps(m);
  check_return(m);
  const bool measured_charge = m.channel(Channel::charge).has_value();
  take_charge(m, specimen, identity.specimen, device);
  check_closure(m);
  check_energy(m);
  count_gaps(m);

  Imported out;
  auto& r = out.recording;
  r.time = std::move(m.time);
  for (const auto channel : all_channels)
    if (auto& values = m.channel(channel)) r.set(channel) = std::move(*values);
  if (m.current) r.others.push_back({{"current", "A", "current"}, std::move(*m.current)});
  for (auto& other : m.others) r.others.push_back(std::move(other));
  r.header.title = identity.title;
  r.header.start_time = iso_now();
  r.header.entry_identifier = to_string(boost::uuids::random_generator()());
  r.header.specimen = std::move(specimen);
  r.header.load = identity.load;
  r.header.charge_reference = measured_charge ? identity.charge_reference : ChargeReference::first_sample;
  device["driver"] = "import";
  device["source"] = identity.source;
  auto& findings = device["findings"] = nlohmann::json::array();
  for (const auto& f : m.findings) {
    findings.push_back({{"kind", f.kind}, {"message", f.message}});
    // What the tester says first belongs to the whole recording.
    if (f.kind != "note") r.events.push_back({std::max(f.time, r.time.front()), f.kind, f.message});
  }
  std::ranges::stable_sort(r.events, {}, &Event::time);
  r.header.device = std::move(device);
  r.segments = infer_segments(r);
  r.end_time = iso_after(r.header.start_time, r.time.back() - r.time.front()).value_or(r.header.start_time);
  out.findings = std::move(m.findings);
  return out;
}

}  // namespace ferrobench::recordings
