"""The methods, results and errors of a ferrobench daemon. Made by generate.py from its rpc.discover; not to be edited.

None leaves a parameter to the daemon's default. Numbers are in SI units unless the name says otherwise.
"""
# ruff: noqa
from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, TypedDict

from ._errors import Error

# What `from api import *` brings: the errors.
__all__ = ["BadModel", "BadProtocol", "BadRecording", "BadState", "Busy", "Cancelled", "DeviceLost",
    "DeviceUnavailable", "DiskFull", "InterlockOpen", "Internal", "InvalidParams", "IoError", "LimitExceeded",
    "NotController", "NotFound", "Numerical", "Unauthorized"]


class BadModel(Error):
    """The model file is not valid."""
    name, code = "bad_model", -32004


class BadProtocol(Error):
    """The field program is not valid."""
    name, code = "bad_protocol", -32002


class BadRecording(Error):
    """The file is not a recording, or is damaged."""
    name, code = "bad_recording", -32003


class BadState(Error):
    """The run's state does not allow this."""
    name, code = "bad_state", -32010


class Busy(Error):
    """A run is in progress."""
    name, code = "busy", -32009


class Cancelled(Error):
    """The job was cancelled."""
    name, code = "cancelled", -32015


class DeviceLost(Error):
    """The device stopped answering."""
    name, code = "device_lost", -32008


class DeviceUnavailable(Error):
    """The device is not there or not permitted."""
    name, code = "device_unavailable", -32007


class DiskFull(Error):
    """There is no room left for the file."""
    name, code = "disk_full", -32014


class InterlockOpen(Error):
    """The interlock is open."""
    name, code = "interlock_open", -32006


class Internal(Error):
    """A defect of the program."""
    name, code = "internal", -32603


class InvalidParams(Error):
    """A parameter is missing, unknown, or out of its range."""
    name, code = "invalid_params", -32602


class IoError(Error):
    """A file could not be read or written."""
    name, code = "io_error", -32013


class LimitExceeded(Error):
    """The request goes beyond a limit of the guard."""
    name, code = "limit_exceeded", -32005


class NotController(Error):
    """Another client holds the lease."""
    name, code = "not_controller", -32011


class NotFound(Error):
    """Nothing has the name or id that was given."""
    name, code = "not_found", -32001


class Numerical(Error):
    """The computation did not converge."""
    name, code = "numerical", -32016


class Unauthorized(Error):
    """The token, host or origin was refused."""
    name, code = "unauthorized", -32012


ERRORS: dict[str, type[Error]] = {"bad_model": BadModel, "bad_protocol": BadProtocol, "bad_recording": BadRecording,
    "bad_state": BadState, "busy": Busy, "cancelled": Cancelled, "device_lost": DeviceLost,
    "device_unavailable": DeviceUnavailable, "disk_full": DiskFull, "interlock_open": InterlockOpen,
    "internal": Internal, "invalid_params": InvalidParams, "io_error": IoError, "limit_exceeded": LimitExceeded,
    "not_controller": NotController, "not_found": NotFound, "numerical": Numerical, "unauthorized": Unauthorized}

# Methods that change nothing of the bench.
VIEWING = frozenset(["device.info", "device.list", "discrepancy.result", "discrepancy.status", "job.list",
    "job.status", "lease.acquire", "lease.present", "lease.release", "lease.renew", "lease.status", "limits.get",
    "model.effects", "model.get", "model.list", "model.schema", "protocol.get", "protocol.list", "protocol.preview",
    "protocol.schema", "protocol.validate", "queue.list", "queue.summary", "recording.compare", "recording.info",
    "recording.list", "recording.read", "recording.report", "rpc.discover", "run.list", "run.status", "subscribe",
    "system.info", "table.compare", "table.list", "unsubscribe"])

# What a connection can subscribe to.
TOPICS = {
    "events": "what the recording notes: limit trips, gaps, pauses, stops",
    "job": "status of a job when it changes",
    "queue": "what the queue does, when that or its items have changed; queue.list has them",
    "run": "status of the run: at each change of state, and five times a second",
    "samples": "smallest and largest value of each channel over stretches of rows, while a run goes on",
}


class JobStatus(TypedDict, total=False):
    error: JobStatusError | None  # {name, message, problems} if it failed
    estimated_end: str  # ISO 8601, while it runs and can be estimated
    job: str
    kind: str  # run, simulate, fit, discover or table
    progress: float
    result: dict[str, Any] | None  # null until it is over; of a fit that was cancelled, the best so far
    stage: str  # what it is at
    state: Literal["running", "complete", "failed", "cancelled"]
    time_left_s: float | None  # [s] estimated, while it runs


class JobStatusError(TypedDict, total=False):
    message: str
    name: str
    problems: list[JobStatusErrorProblem]


class JobStatusErrorProblem(TypedDict, total=False):
    allowed: Any  # one value, a list of them, or {from, to}
    given: Any
    hint: str  # what to do
    message: str  # what is wrong with it
    path: str  # JSON pointer into what was given; "": the whole
    unit: str  # of given and allowed


class RunStatus(TypedDict, total=False):
    device: str
    duration_s: float  # [s] of the whole program, pauses so far included
    ended: str  # ISO 8601, "" while it runs
    ending: Literal["none", "complete", "stopped", "limit", "interlock", "fault", "broken_off"]  # what ended it; none while it runs
    output_at_zero: bool  # false while it runs, or if the device did not obey
    path: str  # its file on the daemon's machine
    progress: float  # share of the rows that have come
    protocol: str
    queue_used: float  # most so far, as a share, of the queue between device and disk
    reason: str  # why it was aborted
    recording: str  # name of the recording; "" if nothing was measured
    rows: int
    rows_expected: int
    rows_on_disk: int  # these survive a power cut
    run: str  # its id; "" if there was none yet
    sample_rate_Hz: float  # [Hz]
    started: str  # ISO 8601
    state: Literal["idle", "arming", "running", "pausing", "paused", "stopping", "complete", "aborted"]
    time_left_s: float | None  # [s] estimated, while it runs
    title: str
    warning: str  # what the person at the bench must do now; "" if nothing


class LeaseStatus(TypedDict, total=False):
    expires_in_s: float  # [s]
    holder: str  # "" if nobody holds it
    lease: str  # to renew, release, or present it; only its holder is told


class Model(TypedDict, total=False):
    model: dict[str, Any] | None  # as JSON; model.schema describes it


class Limits(TypedDict, total=False):
    displacement_max: float  # [m] measured, above it the run stops
    displacement_min: float  # [m] measured, below it the run stops
    field_max: float  # [V/m] highest field of the output
    field_min: float  # [V/m] lowest field of the output
    force_max: float  # [N] measured, above it the run stops
    force_min: float  # [N] measured, below it the run stops
    monitor_margin: float  # share of the field range by which the measured field may go beyond it
    reverse_field_threshold: float  # [V/m] a field below this counts as reverse
    reverse_field_time: float  # [s] longest time at reverse field in one go
    slew: float  # [V/m/s] steepest change of the output
    stop_slew: float  # [V/m/s] slew of every way back to zero; a second stop goes at slew
    stop_time: float  # [s] longest way back to zero, from the largest field at stop_slew; more than 10 s is for an amplifier that is slower, and limits.set then wants the reason


class Protocol(TypedDict, total=False):
    protocol: dict[str, Any] | None  # as JSON; protocol.schema describes it


class DeviceInfo(TypedDict, total=False):
    device: str  # its id, for run.start
    info: dict[str, Any]  # driver, serial number, ranges, rates


class SystemInfo(TypedDict, total=False):
    commit: str
    data_folder: str  # recordings are in "recordings" below it
    limits: Limits  # in force
    run_state: Literal["idle", "arming", "running", "pausing", "paused", "stopping", "complete", "aborted"]
    time: str  # by the daemon's clock, ISO 8601: that of every moment that it tells
    uptime_s: float  # [s]
    version: str


class RecordingInfo(TypedDict, total=False):
    channels: list[str]
    device: dict[str, Any] | None  # what it says of itself
    duration_s: float  # [s]
    end_time: str  # ISO 8601
    events: int  # how many
    identifier: str
    load: dict[str, Any]
    model: dict[str, Any] | None
    name: str
    past: dict[str, Any]  # what the specimen had been through before the first sample
    path: str  # on the daemon's machine
    protocol: dict[str, Any] | None
    reason: str
    rows: int
    run_seed: int | None
    segments: int  # how many
    specimen: dict[str, Any]
    start_time: str  # ISO 8601
    status: str  # running, complete, aborted or recovered
    title: str


class JobList(TypedDict, total=False):
    jobs: list[JobStatus]  # a run is a job as well, and stands in run.list


class RunList(TypedDict, total=False):
    runs: list[RunStatus]  # since the daemon started, newest first


class ModelList(TypedDict, total=False):
    default: str  # used where a run names none
    models: list[ModelListModel]


class ModelListModel(TypedDict, total=False):
    error: str  # why it cannot be used; "" if it can
    name: str
    notes: str  # how it was obtained
    title: str


class QueueList(TypedDict, total=False):
    counts: QueueListCounts  # how many there are of all, by state
    items: list[QueueListItem]  # in the order in which they run and have run
    queue: QueueListQueue  # what it does
    total: int  # how many there are of those asked for


class QueueListCounts(TypedDict, total=False):
    aborted: int
    broken_off: int
    complete: int
    failed: int
    running: int
    waiting: int


class QueueListItem(TypedDict, total=False):
    item: int  # its id
    name: str  # of the plan
    plan: int  # id of its plan; a single run is one as well
    reason: str  # why it is not complete
    recording: str  # of its latest run, if anything was recorded
    repeat: int  # which of the repeats of these values
    run: str  # id of its latest run
    runs: int  # made for it so far; more than one only where a broken one was repeated
    state: Literal["waiting", "running", "complete", "aborted", "failed", "broken_off"]
    values: dict[str, Any]  # what it has of its own among the runs of the plan: settings by key


class QueueListQueue(TypedDict, total=False):
    confirm: str  # what a person must do, then queue.confirm; "": nothing
    item: int  # that is running, or whose turn it is; 0: none
    reason: str  # why it is stopped, or what it waits for
    state: Literal["stopped", "running", "asks", "waits"]  # stopped; running; asks: a person must do and confirm something first; waits: for the bench, or for the condition that the reason says


class TableList(TypedDict, total=False):
    tables: list[TableListTable]  # by name


class TableListTable(TypedDict, total=False):
    name: str  # for table.run and table.compare
    title: str


class DeviceList(TypedDict, total=False):
    kinds: list[DeviceListKind]
    open: list[str]  # ids of the devices that are open
    usb: list[DeviceListUsb]  # units attached now
    usb_problem: str  # why USB cannot be looked at, "" if it can


class DeviceListKind(TypedDict, total=False):
    config: dict[str, Any] | None  # JSON Schema of the configuration
    description: str
    name: str


class DeviceListUsb(TypedDict, total=False):
    drives: bool  # whether this program can play a waveform on it
    name: str  # of the product
    path: str  # where it is plugged in: bus and ports
    permitted: bool  # whether this user may open it
    problem: str  # what is in the way and what to do, "" if nothing
    serial_number: str  # "" if it cannot be read


class ProtocolList(TypedDict, total=False):
    protocols: list[ProtocolListProtocol]


class ProtocolListProtocol(TypedDict, total=False):
    error: str  # why its file cannot be used; "" if it can
    name: str
    notes: str
    parameters: dict[str, float]  # what run.start may set, with its value
    shipped: bool  # false: put here by protocol.put
    source: str  # figure or table that shows it
    title: str
    unit: str  # of levels; rates are in the same per second


class RecordingList(TypedDict, total=False):
    recordings: list[RecordingListRecording]  # newest first


class RecordingListRecording(TypedDict, total=False):
    bytes: int  # [B]
    device: str  # driver
    duration_s: float  # [s]
    model: str
    name: str  # the file is at /recordings/<name>
    prestress_Pa: float | None  # [Pa] compressive is positive
    protocol: str
    reason: str
    rows: int
    spring_stiffness_N_per_m: float | None  # [N/m]
    start_time: str  # ISO 8601
    status: str  # running, broken_off, complete, aborted, recovered or unreadable
    title: str


class QueueAdd(TypedDict, total=False):
    count: int  # how many runs
    first_item: int  # id of the first run in its order; the others follow
    plan: int  # its id; a single run is a plan as well


class Subscribe(TypedDict, total=False):
    subscribed: bool  # whether notifications come from now on
    topic: str


class QueueMove(TypedDict, total=False):
    count: int  # how many items


ModelSchema = TypedDict("ModelSchema", {"$defs": "dict[str, Any]", "$id": "str", "$schema": "str",
    "description": "str", "properties": "dict[str, Any]", "required": "list[str]", "title": "str",
    "type": "Any"}, total=False)


RpcDiscover = TypedDict("RpcDiscover", {"components": "dict[str, Any]", "info": "dict[str, Any]",
    "methods": "list[dict[str, Any]]", "openrpc": "str", "x-notifications": "list[dict[str, Any]]"}, total=False)


class ModelEffects(TypedDict, total=False):
    effects: list[ModelEffectsEffect]  # by id


class ModelEffectsEffect(TypedDict, total=False):
    empirical: bool  # stands for what has no name: a fitted table, never a candidate
    equation: str  # in plain text, SI units
    family: str  # what a report names where the effect cannot be told
    id: str  # as a model's file gives it
    name: str  # as reports give it
    parameters: list[ModelEffectsEffectParameter]  # the first is the amplitude
    shows: str  # the channels and segments in which it is seen


class ModelEffectsEffectParameter(TypedDict, total=False):
    high: float  # upper end of the plausible range
    low: float  # lower end of the plausible range
    name: str  # as a model's file gives it
    off_at: str  # where the whole effect fades: "zero", "infinity", or "" for a parameter of its shape
    sign: str  # what a model's file may hold: "not negative", "above zero", or "any", where the range is that of the magnitude
    unit: str  # of its value and range; 1 where it has none


class QueueSummary(TypedDict, total=False):
    content: str  # the whole summary, in a format other than json
    known_figures: list[str]  # what can be asked for
    means: QueueSummaryMeans
    runs: QueueSummaryMeans
    title: str  # of the plan


class QueueSummaryMeans(TypedDict, total=False):
    columns: list[QueueSummaryMeansColumn]  # in order
    notes: list[str]
    rows: list[dict[str, Any]]
    title: str


class QueueSummaryMeansColumn(TypedDict, total=False):
    key: str
    title: str
    uncertainty: str  # key of the standard uncertainties in its rows, in the column's unit; absent: none are stated
    unit: str  # as people read it


class RecordingRead(TypedDict, total=False):
    axes: list[str]
    charge: RecordingReadCharge
    chord_error: float  # how far points that were left out lie beside the line, as a share of the axes' ranges
    command: RecordingReadCommand
    curves: list[RecordingReadCurve]
    cycles: int  # that the recording has; at most 40 are given
    displacement: RecordingReadDisplacement
    field: RecordingReadCommand
    force: RecordingReadForce
    row: list[int]  # of the recording, with which each stretch begins
    rows: int  # joined into the stretches
    segments: list[RecordingReadSegment]  # the first 1000, where no axes were asked for
    time: list[float]  # of the first row of each stretch
    told_by: str  # what tells the cycles apart: cycle, rate or frequency


class RecordingReadCharge(TypedDict, total=False):
    first: list[float | None]  # null where nothing was measured
    max: list[float | None]  # null where nothing was measured
    min: list[float | None]  # null where nothing was measured


class RecordingReadCommand(TypedDict, total=False):
    first: list[float | None]  # null where nothing was measured
    max: list[float | None]  # null where nothing was measured
    min: list[float | None]  # null where nothing was measured


class RecordingReadCurve(TypedDict, total=False):
    cycle: int | None  # from 1
    frequency_Hz: float  # [Hz] one over the cycle's duration
    label: str  # of the cycle or the hold; "" outside of both
    level: float  # [V/m] of a hold
    rate: float  # [V/m/s] of the longest ramp
    x: list[float | None]
    y: list[float | None]


class RecordingReadDisplacement(TypedDict, total=False):
    first: list[float | None]  # null where nothing was measured
    max: list[float | None]  # null where nothing was measured
    min: list[float | None]  # null where nothing was measured


class RecordingReadForce(TypedDict, total=False):
    first: list[float | None]  # null where nothing was measured
    max: list[float | None]  # null where nothing was measured
    min: list[float | None]  # null where nothing was measured


class RecordingReadSegment(TypedDict, total=False):
    end_s: float  # [s]
    kind: str  # ramp or hold
    label: str
    level: float  # [V/m] at the end
    rate: float  # [V/m/s]
    start_s: float  # [s]


class DeviceSelftest(TypedDict, total=False):
    passed: bool  # every row has
    rows: list[DeviceSelftestRow]
    sample_rate_Hz: float  # [Hz] at which it was tested


class DeviceSelftestRow(TypedDict, total=False):
    highest: float  # that is still good
    lowest: float  # that is still good
    measured: float  # null where the device gave no value
    passed: bool
    quantity: str
    unit: str  # of all three


class ProtocolPreview(TypedDict, total=False):
    duration_s: float  # [s]
    field_max: float  # [V/m]
    field_min: float  # [V/m]
    max: list[float]
    max_slew: float  # [V/m/s]
    min: list[float]
    problems: list[JobStatusErrorProblem]  # limits that the program goes beyond; run.start would refuse it
    recorded_samples: int  # of them, where segments have sample rates of their own
    sample_rate_Hz: float  # [Hz] of the device
    samples: int  # that the device takes
    segments: list[ProtocolPreviewSegment]  # the first 1000
    time: list[float]  # start of each stretch of the decimated waveform
    unit: str  # in which the program was written
    unit_V_per_m: float  # [V/m] size of that unit, on this specimen


class ProtocolPreviewSegment(TypedDict, total=False):
    amplitude: float | None  # [V/m] of a sine
    center: float | None  # [V/m] of a sine
    end_s: float  # [s]
    frequency_Hz: float | None  # [Hz] of a sine
    kind: str  # ramp, hold or sine; a recording's segment table calls a sine a ramp
    label: str  # its name in the segment table
    level: float  # [V/m]
    path: str  # JSON pointer to the protocol's segment that it comes from
    rate: float  # [V/m/s]
    start_s: float  # [s]


class RecordingExport(TypedDict, total=False):
    bytes: int  # [B]
    name: str  # the file is at /recordings/<name>
    path: str  # on the daemon's machine


class RecordingImport(TypedDict, total=False):
    bytes: int  # [B]
    device: str  # driver
    duration_s: float  # [s]
    findings: list[RecordingImportFinding]  # what was checked, taken for what, and found; the recordings have it
    model: str
    name: str  # the file is at /recordings/<name>
    prestress_Pa: float | None  # [Pa] compressive is positive
    protocol: str
    reason: str
    recordings: list[RecordingListRecording]  # all that were made, one for each table; the first is this one
    rows: int
    spring_stiffness_N_per_m: float | None  # [N/m]
    start_time: str  # ISO 8601
    status: str  # running, broken_off, complete, aborted, recovered or unreadable
    title: str


class RecordingImportFinding(TypedDict, total=False):
    kind: str  # note, check, warning, flag (of the tester), pulse or gap
    message: str
    recording: str  # name


class RecordingReport(TypedDict, total=False):
    content: str  # the whole report, in a format other than json
    facts: dict[str, str]
    order: RecordingReportOrder
    title: str


class RecordingReportOrder(TypedDict, total=False):
    facts: list[str]
    tables: list[str]


class ProtocolValidate(TypedDict, total=False):
    problems: list[JobStatusErrorProblem]
    valid: bool


class RecordingAverage(TypedDict, total=False):
    left_out: list[str]  # why other passes have none
    passes: list[int]  # that have a part in it
    path: str
    recording: str  # name of the mean


class RecordingCompare(TypedDict, total=False):
    by_time: bool  # the rows' times differ: rms, mean and maximum are at common times
    columns: list[RecordingCompareColumn]
    header: list[RecordingCompareHeader]
    note: str  # what to know of that; "" where rows are compared one by one
    same_samples: bool
    tables: list[RecordingCompareHeader]


class RecordingCompareColumn(TypedDict, total=False):
    dataset: str  # in the file
    first: RecordingCompareColumnFirst
    identical: bool
    in_a: bool
    in_b: bool
    maximum: float | None  # in the unit
    mean: float | None  # of b - a, in the unit
    rms: float | None  # in the unit
    rows_a: int
    rows_b: int
    unequal: int  # rows
    unit: str


class RecordingCompareColumnFirst(TypedDict, total=False):
    a: float | None
    b: float | None
    row: int


class RecordingCompareHeader(TypedDict, total=False):
    a: Any
    b: Any
    place: str  # in the file


class RecordingRecover(TypedDict, total=False):
    recordings: list[RecordingRecoverRecording]


class RecordingRecoverRecording(TypedDict, total=False):
    message: str  # what was done
    name: str
    outcome: str  # recovered, completed, already_whole, nothing, running or failed
    rows: int  # that the recording has


class EventsMessage(TypedDict, total=False):
    kind: str
    message: str
    run: str  # absent if it concerns none
    time: str  # ISO 8601
    time_s: float  # [s] in the run


class QueueMessage(TypedDict, total=False):
    confirm: str
    item: int
    reason: str
    state: str


class SamplesMessage(TypedDict, total=False):
    columns: SamplesMessageColumns
    measured: str
    run: str


class SamplesMessageColumns(TypedDict, total=False):
    charge: RecordingReadCharge
    command: RecordingReadCommand
    displacement: RecordingReadDisplacement
    field: RecordingReadCommand
    force: RecordingReadForce
    rows: int  # joined into the stretches
    time: list[float]  # of the first row of each stretch


class DiscrepancyResult(TypedDict, total=False):
    added: list[dict[str, Any]]
    asked: dict[str, Any]  # what was asked and of what: model, sources, options, time, software
    explanations: list[dict[str, Any]]
    family: str | None  # kind of an unknown effect
    findings: list[str]  # in sentences
    gap: dict[str, Any]  # residual over noise, before and after
    left: dict[str, DiscrepancyResultLeft]
    model: dict[str, Any]  # the improved one
    pasts: list[dict[str, Any]]
    probability_nothing: float
    probability_unknown: float
    recalibrated: dict[str, DiscrepancyResultRecalibrated]
    remainder: dict[str, Any] | None  # what is left, where it is material: family, channel, segment, of_range
    share: float  # of the excess over noise that the explanation removes; 0 to 1
    share_held_out: float  # likewise, on recordings that were locked away
    verdict: str
    where: list[DiscrepancyResultWhere]


class DiscrepancyResultLeft(TypedDict, total=False):
    model_error: float
    of_range: float
    over_noise: float


DiscrepancyResultRecalibrated = TypedDict("DiscrepancyResultRecalibrated", {"from": "float", "over_prior": "float",
    "std": "float", "to": "float"}, total=False)


class DiscrepancyResultWhere(TypedDict, total=False):
    channel: str
    excess: float
    recording: str
    segment: Any


class Area:
    """The methods that share a first word."""

    def __init__(self, call: Callable[[str, Mapping[str, Any]], Any]):
        self._call = call


class DeviceArea(Area):
    """device.*"""

    def close(self, device: str) -> None:
        """Brings an open device's output to zero and closes it.

        Parameters
        ----------
        device
            id of an open device

        Raises
        ------
        InvalidParams, NotFound, DeviceLost, Busy, BadState, NotController
        """
        return self._call("device.close", {"device": device})

    def info(self, device: str) -> DeviceInfo:
        """What an open device says of itself.

        Parameters
        ----------
        device
            id of an open device

        Raises
        ------
        InvalidParams, NotFound, DeviceLost, Busy, BadState
        """
        return self._call("device.info", {"device": device})

    def list(self) -> DeviceList:
        """The kinds of device there are, those open, and the units attached.

        Raises
        ------
        InvalidParams
        """
        return self._call("device.list", {})

    def open(self, device: str, *, config: Mapping[str, Any] | None = None) -> DeviceInfo:
        """Opens a device that keeps its state from run to run.

        Parameters
        ----------
        device
            a kind of device
        config
            as device.list describes it for this kind

        Raises
        ------
        InvalidParams, NotFound, BadRecording, BadModel, LimitExceeded, DeviceUnavailable, DeviceLost, Busy,
        BadState, NotController, IoError
        """
        return self._call("device.open", {"device": device, "config": config})

    def selftest(self, device: str, *, sample_rate_Hz: float | None = None) -> DeviceSelftest:
        """Plays a small waveform, with the output looped back to the field monitor, and compares. run.abort without
        a run's id stops it.

        Parameters
        ----------
        device
            id of an open device
        sample_rate_Hz
            at which it is tested [Hz]; above 0; at most 1e+09; default 1000.0

        Raises
        ------
        InvalidParams, NotFound, LimitExceeded, InterlockOpen, DeviceUnavailable, DeviceLost, Busy, BadState,
        NotController, Cancelled
        """
        return self._call("device.selftest", {"device": device, "sample_rate_Hz": sample_rate_Hz})


class DiscrepancyArea(Area):
    """discrepancy.*"""

    def result(self, job: str, *, format: Literal["json", "html", "text"] | None = None) -> DiscrepancyResult | str:
        """What a search found: verdict, explanations, where, gap, improved model; or its report.

        Parameters
        ----------
        job
            as discrepancy.start gave it
        format
            json: all of it; html: the report; text: the report for a terminal; default json

        Raises
        ------
        InvalidParams, NotFound, Busy, BadState
        """
        return self._call("discrepancy.result", {"job": job, "format": format})

    def start(self, *, recordings: Sequence[str] | None = None, tables: Sequence[str] | None = None,
            model: str | Mapping[str, Any] | None = None, held_out: Sequence[str] | None = None,
            name: str | None = None, seed: int | None = None, threads: int | None = None,
            floor: float | None = None) -> JobStatus:
        """Finds what a model misses in recordings, names it, adds it, and proves it on unseen ones. A job;
        job.cancel stops it.

        Parameters
        ----------
        recordings
            names of the recordings of the bench
        tables
            in place of recordings: published tables, 3.10 to 3.13
        model
            name or model in question; absent: the default one
        held_out
            names of those to lock away for the proof; absent: chosen
        name
            keeps the improved model under this name
        seed
            of the recalibration's other starts; at least 0; default 1
        threads
            0: as many as the machine has; at least 0; at most 256; default 0
        floor
            what is left counts as material above this share of a channel's range; above 0; at most 1; default 0.002

        Raises
        ------
        InvalidParams, NotFound, Busy, NotController
        """
        return self._call("discrepancy.start", {"recordings": recordings, "tables": tables, "model": model,
            "held_out": held_out, "name": name, "seed": seed, "threads": threads, "floor": floor})

    def status(self, job: str) -> JobStatus:
        """How far a search is: stage, progress, time left.

        Parameters
        ----------
        job
            as discrepancy.start gave it

        Raises
        ------
        InvalidParams, NotFound
        """
        return self._call("discrepancy.status", {"job": job})


class JobArea(Area):
    """job.*"""

    def cancel(self, job: str) -> JobStatus:
        """Cancels a job; a run stops safely.

        Parameters
        ----------
        job
            id of a job or a run

        Raises
        ------
        InvalidParams, NotFound, BadState, NotController
        """
        return self._call("job.cancel", {"job": job})

    def list(self) -> JobList:
        """The jobs of this daemon, newest first, without results.

        Raises
        ------
        InvalidParams
        """
        return self._call("job.list", {})

    def status(self, job: str) -> JobStatus:
        """How far a job is, and its result. Every run is a job as well.

        Parameters
        ----------
        job
            id of a job or a run

        Raises
        ------
        InvalidParams, NotFound
        """
        return self._call("job.status", {"job": job})


class LeaseArea(Area):
    """lease.*"""

    def acquire(self, *, duration_s: float | None = None, stop_run: bool | None = None) -> LeaseStatus:
        """Makes the caller the only one who may control. Another connection may lease.present it, by HTTP as the
        field Ferrobench-Lease. Anybody may still run.abort.

        Parameters
        ----------
        duration_s
            how long without renewal [s]; at least 1; at most 3600; default 60.0
        stop_run
            if the lease runs out, neither renewed nor released, the run under way is stopped safely; default False

        Raises
        ------
        InvalidParams, NotController
        """
        return self._call("lease.acquire", {"duration_s": duration_s, "stop_run": stop_run})

    def present(self, lease: str) -> LeaseStatus:
        """Lets this connection control as well, as long as the lease lasts.

        Parameters
        ----------
        lease
            as lease.acquire told it

        Raises
        ------
        InvalidParams, NotController
        """
        return self._call("lease.present", {"lease": lease})

    def release(self, *, lease: str | None = None) -> None:
        """Gives the lease back.

        Parameters
        ----------
        lease
            "": the one of this connection

        Raises
        ------
        InvalidParams, NotController
        """
        return self._call("lease.release", {"lease": lease})

    def renew(self, *, lease: str | None = None, duration_s: float | None = None) -> LeaseStatus:
        """Keeps the lease for another while.

        Parameters
        ----------
        lease
            "": the one of this connection
        duration_s
            how long without renewal [s]; at least 1; at most 3600; default 60.0

        Raises
        ------
        InvalidParams, NotController
        """
        return self._call("lease.renew", {"lease": lease, "duration_s": duration_s})

    def status(self) -> LeaseStatus:
        """Who controls, if anybody.

        Raises
        ------
        InvalidParams
        """
        return self._call("lease.status", {})


class LimitsArea(Area):
    """limits.*"""

    def get(self) -> Limits:
        """What the guard lets pass.

        Raises
        ------
        InvalidParams
        """
        return self._call("limits.get", {})

    def set(self, *, field_min: float | None = None, field_max: float | None = None, slew: float | None = None,
            stop_slew: float | None = None, stop_time: float | None = None,
            reverse_field_threshold: float | None = None, reverse_field_time: float | None = None,
            displacement_min: float | None = None, displacement_max: float | None = None,
            force_min: float | None = None, force_max: float | None = None, monitor_margin: float | None = None,
            reason: str | None = None) -> Limits:
        """Sets the limits named; the others stay as they are. Not during a run.

        Parameters
        ----------
        field_min
            lowest field of the output [V/m]; at least -1e+09; at most 0
        field_max
            highest field of the output [V/m]; at least 0; at most 1e+09
        slew
            steepest change of the output [V/m/s]; above 0; at most 1e+12
        stop_slew
            slew of every way back to zero; a second stop goes at slew [V/m/s]; above 0; at most 1e+12
        stop_time
            longest way back to zero, from the largest field at stop_slew; more than 10 s is for an amplifier that
            is slower, and limits.set then wants the reason [s]; above 0; at most 120
        reverse_field_threshold
            a field below this counts as reverse [V/m]; at least -1e+09; at most 0
        reverse_field_time
            longest time at reverse field in one go [s]; at least 0; at most 1e+09
        displacement_min
            measured, below it the run stops [m]; at most 0
        displacement_max
            measured, above it the run stops [m]; at least 0
        force_min
            measured, below it the run stops [N]
        force_max
            measured, above it the run stops [N]
        monitor_margin
            share of the field range by which the measured field may go beyond it; at least 0; at most 1
        reason
            told with the change; wanted where a stop may take longer than 10 s

        Raises
        ------
        InvalidParams, Busy, BadState, NotController
        """
        return self._call("limits.set", {"field_min": field_min, "field_max": field_max, "slew": slew,
            "stop_slew": stop_slew, "stop_time": stop_time, "reverse_field_threshold": reverse_field_threshold,
            "reverse_field_time": reverse_field_time, "displacement_min": displacement_min,
            "displacement_max": displacement_max, "force_min": force_min, "force_max": force_max,
            "monitor_margin": monitor_margin, "reason": reason})


class ModelArea(Area):
    """model.*"""

    def effects(self, *, effect: str | None = None) -> ModelEffects:
        """The catalogue: the effects that a model may hold beside its physics, and that a search for what a model
        misses can name.

        Parameters
        ----------
        effect
            id of the one asked for; "": all

        Raises
        ------
        InvalidParams, NotFound
        """
        return self._call("model.effects", {"effect": effect})

    def fit(self, *, recordings: Sequence[str] | None = None, model: str | Mapping[str, Any] | None = None,
            name: str | None = None, tables: Sequence[str] | None = None, free: Sequence[str] | None = None,
            set: Mapping[str, Any] | None = None, starts: int | None = None, iterations: int | None = None,
            seed: int | None = None, calibrate: bool | None = None, report: bool | None = None) -> JobStatus:
        """Fits a model to published tables or to recordings, or calibrates it. A job; cancelled, its result is the
        best so far, which is kept under no name.

        Parameters
        ----------
        recordings
            names of the recordings to come near to
        model
            name or model to start from; absent: the default one
        name
            keeps the fitted model under this name
        tables
            published tables to come near to, fitted together, by the simulation that table.run uses
        free
            paths of the parameters that move, for example material.barrier
        set
            parameters of the tables' protocols, for example {"rate": 10}
        starts
            starts: the first is the model given, each of the others comes from a global search; at least 1; at most
            1000; default 6
        iterations
            of each least-squares solution, at most; at least 1; at most 10000; default 30
        seed
            of the global searches; at least 0; default 1
        calibrate
            take the critical force of the parametrized polycrystal from one slow loop, or from two at different
            prestress; nothing is fitted; default False
        report
            a page with pictures, as "html" of the result; default False

        Raises
        ------
        InvalidParams, NotFound, Busy, NotController
        """
        return self._call("model.fit", {"recordings": recordings, "model": model, "name": name, "tables": tables,
            "free": free, "set": set, "starts": starts, "iterations": iterations, "seed": seed,
            "calibrate": calibrate, "report": report})

    def get(self, name: str) -> Model:
        """A model by name.

        Parameters
        ----------
        name
            of a model, as model.list gives it

        Raises
        ------
        InvalidParams, NotFound, BadModel, IoError
        """
        return self._call("model.get", {"name": name})

    def list(self) -> ModelList:
        """The shipped models and those put here.

        Raises
        ------
        InvalidParams, BadModel, Busy, IoError
        """
        return self._call("model.list", {})

    def put(self, name: str, model: str | Mapping[str, Any] | None) -> None:
        """Keeps a model under a name.

        Parameters
        ----------
        name
            to keep it under
        model
            as JSON; model.schema describes it

        Raises
        ------
        InvalidParams, BadModel, NotController, IoError, DiskFull
        """
        return self._call("model.put", {"name": name, "model": model})

    def schema(self) -> ModelSchema:
        """JSON Schema of a model.

        Raises
        ------
        InvalidParams
        """
        return self._call("model.schema", {})

    def simulate(self, recording: str, *, model: str | Mapping[str, Any] | None = None,
            past: Mapping[str, Any] | None = None) -> JobStatus:
        """Plays a recording's own program through a model, without noise, into a new recording. A job.

        Parameters
        ----------
        recording
            name of a recording
        model
            name or model; absent: the recording's own
        past
            what the specimen has been through before; absent: what the recording says or, where it does not, poled
            towards +

        Raises
        ------
        InvalidParams, NotFound, Busy, NotController
        """
        return self._call("model.simulate", {"recording": recording, "model": model, "past": past})


class ProtocolArea(Area):
    """protocol.*"""

    def get(self, name: str) -> Protocol:
        """A protocol by name.

        Parameters
        ----------
        name
            of a protocol, as protocol.list gives it

        Raises
        ------
        InvalidParams, NotFound, BadProtocol, IoError
        """
        return self._call("protocol.get", {"name": name})

    def list(self) -> ProtocolList:
        """The shipped experiments and those put here.

        Raises
        ------
        InvalidParams, BadProtocol, Busy, IoError
        """
        return self._call("protocol.list", {})

    def preview(self, protocol: str | Mapping[str, Any] | None, *, model: str | Mapping[str, Any] | None = None,
            set: Mapping[str, Any] | None = None, max_points: int | None = None) -> ProtocolPreview:
        """What a run on the virtual device would do: its length, extremes and waveform.

        Parameters
        ----------
        protocol
            name of a protocol, or a protocol
        model
            as for run.start
        set
            as for run.start
        max_points
            of the decimated waveform; at least 2; at most 20000; default 1000

        Raises
        ------
        InvalidParams, NotFound, BadProtocol, BadModel, LimitExceeded, Busy, BadState, IoError
        """
        return self._call("protocol.preview", {"protocol": protocol, "model": model, "set": set,
            "max_points": max_points})

    def put(self, name: str, protocol: str | Mapping[str, Any] | None) -> None:
        """Keeps a protocol under a name, which becomes its own.

        Parameters
        ----------
        name
            to keep it under
        protocol
            as JSON; protocol.schema describes it

        Raises
        ------
        InvalidParams, BadProtocol, Busy, NotController, IoError, DiskFull
        """
        return self._call("protocol.put", {"name": name, "protocol": protocol})

    def schema(self) -> ModelSchema:
        """JSON Schema of a protocol.

        Raises
        ------
        InvalidParams
        """
        return self._call("protocol.schema", {})

    def validate(self, protocol: str | Mapping[str, Any] | None) -> ProtocolValidate:
        """Every problem of a protocol with its path.

        Parameters
        ----------
        protocol
            as JSON; protocol.schema describes it

        Raises
        ------
        InvalidParams, BadProtocol
        """
        return self._call("protocol.validate", {"protocol": protocol})


class QueueArea(Area):
    """queue.*"""

    def add(self, *, run: Mapping[str, Any] | None = None, plan: Mapping[str, Any] | None = None) -> QueueAdd:
        """Puts a run or a plan at the end of the queue, and starts nothing. All its runs are checked against models
        and limits first.

        Parameters
        ----------
        run
            a single run; or a plan:
        plan
            a run over lists or ranges of its settings

        Raises
        ------
        InvalidParams, NotFound, BadProtocol, BadModel, LimitExceeded, NotController, IoError, DiskFull, Numerical
        """
        return self._call("queue.add", {"run": run, "plan": plan})

    def confirm(self, item: int) -> QueueListQueue:
        """Says that what the queue asks for is done. The next run begins at once.

        Parameters
        ----------
        item
            id of the item that asks for it; at least 1

        Raises
        ------
        InvalidParams, NotFound, BadState, NotController, IoError, DiskFull
        """
        return self._call("queue.confirm", {"item": item})

    def list(self, *, first: int | None = None, count: int | None = None, plan: int | None = None,
            state: Literal["waiting", "running", "complete", "aborted", "failed", "broken_off"] | None = None) -> QueueList:
        """What the queue does, and a page of its items.

        Parameters
        ----------
        first
            how many to leave out at the beginning; at least 0; at most 1e+09; default 0
        count
            how many at most; at least 0; at most 1000; default 100
        plan
            of this plan alone; 0: of all; at least 0; default 0
        state
            in this state alone; absent: in any

        Raises
        ------
        InvalidParams, IoError, DiskFull
        """
        return self._call("queue.list", {"first": first, "count": count, "plan": plan, "state": state})

    def move(self, *, item: int | None = None, plan: int | None = None, before: int | None = None,
            first: bool | None = None) -> QueueMove:
        """Moves what waits before another item, to the front or to the end.

        Parameters
        ----------
        item
            id of an item; or:; at least 0; default 0
        plan
            id of a plan, for all its items; at least 0; default 0
        before
            id of another item that waits; absent: to the end, unless; at least 1
        first
            before all others that wait; default False

        Raises
        ------
        InvalidParams, NotFound, LimitExceeded, BadState, NotController, IoError, DiskFull
        """
        return self._call("queue.move", {"item": item, "plan": plan, "before": before, "first": first})

    def remove(self, *, item: int | None = None, plan: int | None = None) -> QueueMove:
        """Forgets items, whether they wait or are over. Their recordings stay.

        Parameters
        ----------
        item
            id of an item; or:; at least 0; default 0
        plan
            id of a plan, for all its items; at least 0; default 0

        Raises
        ------
        InvalidParams, NotFound, Busy, NotController, IoError, DiskFull
        """
        return self._call("queue.remove", {"item": item, "plan": plan})

    def start(self) -> QueueListQueue:
        """Runs what waits, one after the other. Plans that say so go on after a restart of the daemon from now on.

        Raises
        ------
        InvalidParams, BadState, NotController, IoError, DiskFull
        """
        return self._call("queue.start", {})

    def stop(self) -> QueueListQueue:
        """No further run begins; the one under way goes on, which run.abort stops, and the queue with it.

        Raises
        ------
        InvalidParams, NotController, IoError, DiskFull
        """
        return self._call("queue.stop", {})

    def summary(self, plan: int, *, figures: Sequence[str] | None = None,
            of: Literal["mean", "first", "last", "min", "max"] | None = None,
            format: str | None = None) -> QueueSummary:
        """A plan's recordings at a glance: figures of their reports against what was swept, run by run and as means
        over the repeats.

        Parameters
        ----------
        plan
            its id; at least 1
        figures
            of a report, TABLE.COLUMN, for example stroke.stroke_um; none: those of strokes and hysteresis
        of
            what is taken of a table with several rows; default mean
        format
            json; text, md, csv and html, which has a picture, give {content}; default json

        Raises
        ------
        InvalidParams, NotFound, Busy, IoError, DiskFull
        """
        return self._call("queue.summary", {"plan": plan, "figures": figures, "of": of, "format": format})


class RecordingArea(Area):
    """recording.*"""

    def annotate(self, name: str, text: str, *, time_s: float | None = None) -> RecordingListRecording:
        """Adds a note to a recording's events.

        Parameters
        ----------
        name
            of a recording
        text
            the note
        time_s
            moment of the recording that it concerns [s]; at least 0; default 0.0

        Raises
        ------
        InvalidParams, NotFound, BadRecording, Busy, BadState, NotController, IoError, DiskFull
        """
        return self._call("recording.annotate", {"name": name, "text": text, "time_s": time_s})

    def average(self, name: str) -> RecordingAverage:
        """The mean over the passes of the protocol's averaged repeat, but the first, as a new recording.

        Parameters
        ----------
        name
            of a recording

        Raises
        ------
        InvalidParams, NotFound, BadRecording, LimitExceeded, Busy, NotController, IoError, DiskFull
        """
        return self._call("recording.average", {"name": name})

    def compare(self, a: str, b: str) -> RecordingCompare:
        """Two recordings: rms, maximum and first difference of each channel, and what else differs.

        Parameters
        ----------
        a
            name of a recording
        b
            name of the other

        Raises
        ------
        InvalidParams, NotFound, BadRecording, LimitExceeded, Busy, IoError, Cancelled
        """
        return self._call("recording.compare", {"a": a, "b": b})

    def delete(self, name: str) -> None:
        """Deletes a recording.

        Parameters
        ----------
        name
            of a recording

        Raises
        ------
        InvalidParams, NotFound, BadRecording, Busy, BadState, NotController, IoError, DiskFull
        """
        return self._call("recording.delete", {"name": name})

    def export(self, name: str) -> RecordingExport:
        """Writes the samples as CSV beside the recording.

        Parameters
        ----------
        name
            of a recording

        Raises
        ------
        InvalidParams, NotFound, BadRecording, Busy, BadState, NotController, IoError, DiskFull
        """
        return self._call("recording.export", {"name": name})

    def import_(self, name: str, csv: str, *, length_m: float | None = None, area_m2: float | None = None,
            layer_thickness_m: float | None = None, title: str | None = None, source: str | None = None,
            delimiter: Literal[",", ";", "\t", " "] | None = None, decimal_comma: bool | None = None,
            header: bool | None = None, time: Mapping[str, Any] | None = None, sample_rate_Hz: float | None = None,
            command: Mapping[str, Any] | None = None, field: Mapping[str, Any] | None = None,
            charge: Mapping[str, Any] | None = None, displacement: Mapping[str, Any] | None = None,
            force: Mapping[str, Any] | None = None, specimen: str | None = None, layer_count: int | None = None,
            spring_stiffness_N_per_m: float | None = None, prestress_Pa: float | None = None,
            charge_is_absolute: bool | None = None, current: Mapping[str, Any] | None = None,
            polarization: Mapping[str, Any] | None = None,
            as_: Literal["aixacct", "radiant", "b1500", "datavalue", "csv"] | None = None) -> RecordingImport:
        """Makes a recording of each table that a tester or another program wrote.

        Parameters
        ----------
        name
            of the new recording; of several, name-table-01 and so on
        csv
            the text: a table, or what a tester wrote
        length_m
            of the stack; absent, where no displacement was measured or a tester's file says the layers: that of its
            layers [m]; above 0
        area_m2
            of one layer's electrode; needed unless the file says it [m^2]; above 0
        layer_thickness_m
            turns a voltage into a field; needed unless the file says it [m]; above 0
        title
            of the recording
        source
            where it comes from; kept in the recording
        delimiter
            between cells; a space is any white space; absent: found
        decimal_comma
            1,5 is one and a half; absent: found
        header
            whether the first row holds names; absent: found
        time
            column of the time; absent, as for each channel: the one that is named so [s]
        sample_rate_Hz
            in place of a column of the time [Hz]; above 0
        command
            column of this channel, if it was measured; absent: named so
        field
            column of this channel, if it was measured; absent: named so
        charge
            column of this channel, if it was measured; absent: named so
        displacement
            column of this channel, if it was measured; absent: named so
        force
            column of this channel, if it was measured; absent: named so
        specimen
            name
        layer_count
            layers of the stack; absent: as the file says, or 1; at least 1
        spring_stiffness_N_per_m
            of the spring that it works against; 0: none [N/m]; at least 0; default 0.0
        prestress_Pa
            that it is under; compression positive [Pa]; at least -1e+09; at most 1e+10; default 0.0
        charge_is_absolute
            false: its zero is the first sample; default False
        current
            column of the current, if it was measured; without charge and polarization its integral is the charge
        polarization
            column of the polarization, in place of the charge
        as_
            kind of the text; absent: found

        Raises
        ------
        InvalidParams, NotFound, BadRecording, Busy, BadState, NotController, IoError, DiskFull
        """
        return self._call("recording.import", {"name": name, "csv": csv, "length_m": length_m, "area_m2": area_m2,
            "layer_thickness_m": layer_thickness_m, "title": title, "source": source, "delimiter": delimiter,
            "decimal_comma": decimal_comma, "header": header, "time": time, "sample_rate_Hz": sample_rate_Hz,
            "command": command, "field": field, "charge": charge, "displacement": displacement, "force": force,
            "specimen": specimen, "layer_count": layer_count, "spring_stiffness_N_per_m": spring_stiffness_N_per_m,
            "prestress_Pa": prestress_Pa, "charge_is_absolute": charge_is_absolute, "current": current,
            "polarization": polarization, "as": as_})

    def info(self, name: str) -> RecordingInfo:
        """All that a recording says beside its samples.

        Parameters
        ----------
        name
            of a recording

        Raises
        ------
        InvalidParams, NotFound, BadRecording, LimitExceeded, Busy, IoError, Cancelled
        """
        return self._call("recording.info", {"name": name})

    def list(self) -> RecordingList:
        """The recordings of this bench.

        Raises
        ------
        InvalidParams, Busy, IoError
        """
        return self._call("recording.list", {})

    def read(self, name: str, *, first: int | None = None, rows: int | None = None, max_points: int | None = None,
            axes: Sequence[str] | None = None, pixels: int | None = None) -> RecordingRead:
        """Samples to draw, in SI: {time, <channel>: {first, min, max}}, or the curves in two axes. For all of them,
        get the file.

        Parameters
        ----------
        name
            of a recording
        first
            row to begin with; at least 0; default 0
        rows
            absent: to the end; at least 1
        max_points
            more rows are joined to first, min and max; the file has them all; at least 1; at most 20000; default
            2000
        axes
            two of time and the channels, for example field and displacement: curves cycle by cycle, thinned by
            their length in these axes; time_in_hold and a channel: the change since the start of each long hold;
            absent: every channel against time
        pixels
            of the picture's sides: curves are true to half of one; at least 10; at most 10000; default 1000

        Raises
        ------
        InvalidParams, NotFound, BadRecording, LimitExceeded, Busy, IoError, Cancelled
        """
        return self._call("recording.read", {"name": name, "first": first, "rows": rows, "max_points": max_points,
            "axes": axes, "pixels": pixels})

    def recover(self, *, name: str | None = None) -> RecordingRecover:
        """Makes the files of runs that broke off, as each start of the daemon does.

        Parameters
        ----------
        name
            of a recording; "": every one whose run broke off

        Raises
        ------
        InvalidParams, NotFound, BadRecording, Busy, BadState, NotController, IoError, DiskFull
        """
        return self._call("recording.recover", {"name": name})

    def report(self, name: str, *, format: str | None = None) -> RecordingReport:
        """Stroke, hysteresis, creep, rates, minor loops, pulses and the small-signal response.

        Parameters
        ----------
        name
            of a recording
        format
            json gives the report itself; text, md, csv and html give {content}; default json

        Raises
        ------
        InvalidParams, NotFound, BadRecording, LimitExceeded, Busy, IoError, Cancelled
        """
        return self._call("recording.report", {"name": name, "format": format})


class ReplayArea(Area):
    """replay.*"""

    def start(self, recording: str, *, fast: bool | None = None, speed: float | None = None,
            from_s: float | None = None, to_s: float | None = None, set: Mapping[str, Any] | None = None,
            notes: str | None = None, idempotency_key: str | None = None) -> RunStatus:
        """Runs a recording again as it was measured, into a new recording.

        Parameters
        ----------
        recording
            name of a recording
        fast
            as fast as it can go, whatever the speed; default False
        speed
            times the recorded speed; at least 1; at most 1e+06; default 1.0
        from_s
            start of the part to play; absent: the recording's [s]
        to_s
            end of the part to play; absent: the recording's [s]
        set
            values by key: device.<channel>.gain, device.<channel>.offset (SI), device.played
        notes
            kept in the recording
        idempotency_key
            a second start with the same key returns the first one's run

        Raises
        ------
        InvalidParams, NotFound, BadProtocol, BadRecording, BadModel, LimitExceeded, InterlockOpen,
        DeviceUnavailable, DeviceLost, Busy, BadState, NotController, IoError, DiskFull, Numerical
        """
        return self._call("replay.start", {"recording": recording, "fast": fast, "speed": speed, "from_s": from_s,
            "to_s": to_s, "set": set, "notes": notes, "idempotency_key": idempotency_key})


class RpcArea(Area):
    """rpc.*"""

    def discover(self) -> RpcDiscover:
        """This document: every method with its parameters, result and errors (OpenRPC).

        Raises
        ------
        InvalidParams
        """
        return self._call("rpc.discover", {})


class RunArea(Area):
    """run.*"""

    def abort(self, *, run: str | None = None, reason: str | None = None) -> RunStatus:
        """The emergency stop: the output ramps to zero at stop_slew; asked for a second time, at slew. Without a
        run's id a self-test is stopped too. The queue stops with it. For everybody, whoever holds the lease.

        Parameters
        ----------
        run
            "": the latest
        reason
            kept in the recording, beside who stopped it

        Raises
        ------
        InvalidParams, NotFound, BadState
        """
        return self._call("run.abort", {"run": run, "reason": reason})

    def list(self) -> RunList:
        """The runs since the daemon started.

        Raises
        ------
        InvalidParams
        """
        return self._call("run.list", {})

    def pause(self, *, run: str | None = None) -> RunStatus:
        """Waits in the next hold, which gets longer; samples keep coming.

        Parameters
        ----------
        run
            "": the latest

        Raises
        ------
        InvalidParams, NotFound, DeviceLost, BadState, NotController
        """
        return self._call("run.pause", {"run": run})

    def resume(self, *, run: str | None = None) -> RunStatus:
        """Goes on after a pause.

        Parameters
        ----------
        run
            "": the latest

        Raises
        ------
        InvalidParams, NotFound, DeviceLost, BadState, NotController
        """
        return self._call("run.resume", {"run": run})

    def start(self, *, protocol: str | Mapping[str, Any] | None = None, device: str | None = None,
            config: Mapping[str, Any] | None = None, model: str | Mapping[str, Any] | None = None,
            fast: bool | None = None, seed: int | None = None, set: Mapping[str, Any] | None = None,
            notes: str | None = None, rerun_of: str | None = None, idempotency_key: str | None = None) -> RunStatus:
        """Checks a program against the limits, starts it and returns at once.

        Parameters
        ----------
        protocol
            name of a protocol that ships or was put here, or a protocol; none for a replay, which has its own
        device
            a kind of device (opened for this run alone), one opened before, or "replay:NAME" of a recording;
            default virtual
        config
            of a device that is opened for this run, as device.list describes it
        model
            name of a model, or a model; for the virtual device
        fast
            virtual device and replay: as fast as it can go, not in real time; default False
        seed
            virtual device: of the noise; same seed, same bytes; at least 0; default 1
        set
            values by key: parameters of the protocol, prestress_Pa, prestress_MPa, spring_stiffness_N_per_m,
            sample_rate_Hz, model.<path>, device.<path>
        notes
            kept in the recording
        rerun_of
            identifier of the recording that this run repeats; kept in it
        idempotency_key
            a second start with the same key returns the first one's run

        Raises
        ------
        InvalidParams, NotFound, BadProtocol, BadRecording, BadModel, LimitExceeded, InterlockOpen,
        DeviceUnavailable, DeviceLost, Busy, BadState, NotController, IoError, DiskFull, Numerical
        """
        return self._call("run.start", {"protocol": protocol, "device": device, "config": config, "model": model,
            "fast": fast, "seed": seed, "set": set, "notes": notes, "rerun_of": rerun_of,
            "idempotency_key": idempotency_key})

    def status(self, *, run: str | None = None) -> RunStatus:
        """State, progress and time left.

        Parameters
        ----------
        run
            "": the latest

        Raises
        ------
        InvalidParams, NotFound
        """
        return self._call("run.status", {"run": run})


class SystemArea(Area):
    """system.*"""

    def info(self) -> SystemInfo:
        """Versions, uptime and the limits in force.

        Raises
        ------
        InvalidParams
        """
        return self._call("system.info", {})


class TableArea(Area):
    """table.*"""

    def compare(self, table: str, recordings: Sequence[str]) -> QueueSummaryMeans:
        """The cells of a published table as recordings of this bench have them.

        Parameters
        ----------
        table
            of the source: 3.10, 3.11, 3.12 or 3.13
        recordings
            names of recordings

        Raises
        ------
        InvalidParams, NotFound, BadRecording, LimitExceeded, Busy, IoError, Cancelled
        """
        return self._call("table.compare", {"table": table, "recordings": recordings})

    def list(self) -> TableList:
        """The published tables of the source.

        Raises
        ------
        InvalidParams
        """
        return self._call("table.list", {})

    def run(self, table: str, *, model: str | Mapping[str, Any] | None = None, set: Mapping[str, Any] | None = None,
            seed: int | None = None, format: str | None = None) -> JobStatus:
        """Runs a published table's experiments on virtual devices of their own, beside the bench, and compares. A
        job; no recording is kept.

        Parameters
        ----------
        table
            of the source: 3.10, 3.11, 3.12 or 3.13
        model
            name or model; absent: the shipped set of the table's specimen
        set
            as for run.start, for every run of the table
        seed
            of the noise; at least 0; default 1
        format
            of the job's result: json gives the comparison itself; text, md, csv and html give {content}; default
            json

        Raises
        ------
        InvalidParams, NotFound, Busy, NotController
        """
        return self._call("table.run", {"table": table, "model": model, "set": set, "seed": seed, "format": format})


class Methods(Area):
    """Every method of the daemon, by area and verb: methods.run.start(...)."""

    def __init__(self, call: Callable[[str, Mapping[str, Any]], Any]):
        super().__init__(call)
        self.device = DeviceArea(call)
        self.discrepancy = DiscrepancyArea(call)
        self.job = JobArea(call)
        self.lease = LeaseArea(call)
        self.limits = LimitsArea(call)
        self.model = ModelArea(call)
        self.protocol = ProtocolArea(call)
        self.queue = QueueArea(call)
        self.recording = RecordingArea(call)
        self.replay = ReplayArea(call)
        self.rpc = RpcArea(call)
        self.run = RunArea(call)
        self.system = SystemArea(call)
        self.table = TableArea(call)

    def subscribe(self, topic: str, *, max_rate_Hz: float | None = None) -> Subscribe:
        """Sends notifications of a topic on this connection from now on.

        Parameters
        ----------
        topic
            what to be told of; rpc.discover lists the topics
        max_rate_Hz
            merge messages to at most so many a second [Hz]; at least 0.01; at most 1000

        Raises
        ------
        InvalidParams, NotFound, BadState
        """
        return self._call("subscribe", {"topic": topic, "max_rate_Hz": max_rate_Hz})

    def unsubscribe(self, topic: str) -> Subscribe:
        """Ends the notifications of a topic on this connection.

        Parameters
        ----------
        topic
            what not to be told of any more

        Raises
        ------
        InvalidParams, NotFound, BadState
        """
        return self._call("unsubscribe", {"topic": topic})
