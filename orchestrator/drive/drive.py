"""One drive from its inputs to its files: starts the processes, runs the loop, ends everything."""

from __future__ import annotations

import contextlib
import datetime
import logging
import signal
import time
from pathlib import Path

from foretwin.contracts import trace
from foretwin.contracts.bus import Mailbox, Reply, ZenohBus
from foretwin.contracts.cpu_use import CpuMeter
from foretwin.contracts.drive import InfoRequest
from foretwin.contracts.end_signals import on_end_signals
from foretwin.contracts.keys import alive_key
from foretwin.contracts.new_folder import new_folder
from foretwin.contracts.process import log_to_file
from foretwin.contracts.setup import ProcessSetup
from foretwin.contracts.simulation import RunEnd
from foretwin.orchestrator.config import DriveConfig
from foretwin.orchestrator.drive.conductor import Conductor
from foretwin.orchestrator.drive.in_charge import InCharge
from foretwin.orchestrator.drive.intake import unannounced
from foretwin.orchestrator.drive.live_loop import LiveLoop
from foretwin.orchestrator.drive.lock_step import LockStepLoop
from foretwin.orchestrator.drive.mission import Mission, MissionSettings
from foretwin.orchestrator.drive.plan import make_plan, read_inputs
from foretwin.orchestrator.drive.process_watch import ProcessWatch
from foretwin.orchestrator.drive.processes import (
    BUILDER,
    ORCHESTRATOR,
    PROCESSES,
    ROUTER,
    process_ids,
    row_of,
)
from foretwin.orchestrator.drive.progress import ProgressLine, waiting_text
from foretwin.orchestrator.drive.router_start import join_bus, on_local_bus
from foretwin.orchestrator.drive.run_record import lost_lines, reserve_record, run_record
from foretwin.orchestrator.drive.start_worlds import prepare_start
from foretwin.orchestrator.drive.summary import summary_text
from foretwin.orchestrator.plan import DrivePlan
from foretwin.orchestrator.record.results import ResultTables
from foretwin.orchestrator.record.run_state import LOG, RECORD, RESULTS, run_lock, write_record
from foretwin.orchestrator.record.versions import versions
from foretwin.orchestrator.routing.route_ahead import WayAhead
from foretwin.orchestrator.runner.supervisor import FreshInterpreter, Supervisor, fold_stderr

log = logging.getLogger(ORCHESTRATOR)

START_TIMEOUT_S = 120.0
END_GRACE_S, LOCK_STEP_GRACE_S = 10.0, 120.0
"""What recorder and viewer get to write at the end of a drive, live and where nothing may miss."""
LAST_WORDS_S = 0.1
"""How long nothing may come from processes that have ended before all is taken for heard."""
INTERRUPT_GRACE_S = 1.2

EXIT_DONE, EXIT_FAILED, EXIT_PARTLY, EXIT_INTERRUPTED = 0, 1, 3, 130


class DriveError(RuntimeError):
    """A drive that could not go on; the message says why."""


class _Interrupt:
    """Remembers Ctrl-C, SIGTERM and a closed terminal for the loops; nothing is torn away."""

    def __init__(self) -> None:
        self.asked = False
        signal.signal(signal.SIGINT, lambda *_: self._remember())
        on_end_signals(self._remember)

    def _remember(self) -> None:
        self.asked = True


def drive(config: DriveConfig) -> int:
    """Run one drive; returns its exit code. Raises UserError before anything is written."""
    inputs = read_inputs(config)
    with new_folder(Path(config.out)):
        return carry_out(make_plan(inputs, datetime.datetime.now()))


def carry_out(plan: DrivePlan) -> int:
    """Run a drive whose folder is made; returns its exit code."""
    log_to_file(
        ProcessSetup(
            run_id=plan.run_id,
            process_id=ORCHESTRATOR,
            vehicle_id=plan.config.vehicle_id,
            bus=plan.bus,
            log_file=str(plan.folder / LOG),
        )
    )
    with run_lock(plan.folder), trace.whole_run(plan.trace_dir, ORCHESTRATOR):
        return _Drive(on_local_bus(plan)).run()


class _Drive:
    """The processes of one drive and the loop over them."""

    def __init__(self, plan: DrivePlan) -> None:
        self._plan = plan
        self._interrupt = _Interrupt()
        self._supervisor = Supervisor(FreshInterpreter(plan.processes_dir))
        self._watch = ProcessWatch(self._supervisor)
        self._meter = CpuMeter(plan.processes_dir, ORCHESTRATOR)
        self._failed_at_end = False
        self._mission = Mission(
            WayAhead(plan.graph, plan.junctions, plan.routes, index=plan.index),
            MissionSettings(
                radius_m=plan.config.radius_m,
                look_ahead_s=plan.config.look_ahead_s,
                horizon_s=plan.config.horizon_s,
            ),
        )

    def run(self) -> int:
        """Run to the end, whatever ends it; the run's files are complete afterwards."""
        plan = self._plan
        started_s = time.monotonic()
        log.info("run %s in %s, versions %s", plan.run_id, plan.folder, versions())
        with join_bus(plan, self._supervisor) as bus:
            tables = ResultTables(
                plan.folder / RESULTS, plan.origin, lossless=plan.config.lock_step, keep=plan.keep
            )
            conductor = Conductor(plan, bus, self._mission, tables)
            exit_word, code = "failed", EXIT_FAILED
            with ProgressLine(conductor, self._mission) as line:
                line.say(f"run {plan.folder}")
                line.say(plan.config.tuning_choice.text)
                conductor.events.on_event = line.tell
                try:
                    exit_word, code = self._go(bus, conductor, line)
                except Exception:
                    log.exception("the drive ended by an error")
                    raise
                finally:
                    whole = self._end(bus, conductor, line, exit_word, started_s)
        if self._failed_at_end:
            return EXIT_FAILED
        return EXIT_PARTLY if code == EXIT_DONE and not whole else code

    def _go(self, bus: ZenohBus, conductor: Conductor, line: ProgressLine) -> tuple[str, int]:
        conductor.join()
        # A run that is listed can be spoken to: questions wait in the mailbox from here on.
        reserve_record(self._plan, self._plan.folder / RECORD)
        self._start_processes()
        conductor.rounds.draw_cases()  # while they come up
        if self._plan.config.resolved_source == "live":
            line.say(waiting_text(self._plan))
        if not self._join_processes(bus, conductor):
            return "interrupted", EXIT_INTERRUPTED
        prepare_start(self._plan, conductor, look_after=self._look_after, stop=self._stop)
        bus.declare_alive(alive_key(run=self._plan.run_id, process=ORCHESTRATOR))
        self._meter.ready()

        def housekeeping(now_s: float) -> None:
            self._look_after(conductor, now_s)
            self._supervisor.let_give_way(conductor.alive, now_s)
            conductor.rounds.dispatcher.give_out()
            line.update(now_s)

        loop: LockStepLoop | LiveLoop
        if self._plan.config.lock_step:
            loop = LockStepLoop(conductor, housekeeping=housekeeping, stop=self._stop)
        else:
            towards = self._plan.towards_vehicle
            in_charge = InCharge(bus, self._plan).say if towards else lambda: None
            loop = LiveLoop(
                conductor, housekeeping=housekeeping, stop=self._stop, each_turn=in_charge
            )
        ended = loop.run()
        if self._watch.ended_by is not None and not self._interrupt.asked:
            raise DriveError(f"{self._watch.ended_by}; see log.jsonl")
        if not ended:
            return "interrupted", EXIT_INTERRUPTED
        conductor.finish()
        return "completed", EXIT_DONE

    def _stop(self) -> bool:
        return self._interrupt.asked or self._watch.ended_by is not None

    def _start_processes(self) -> None:
        for row in PROCESSES:
            for process_id in process_ids(row, self._plan):
                if process_id == ROUTER:
                    continue  # it runs already: we are on its bus
                setup = row.setup(self._plan, process_id)
                self._supervisor.start(row_of(row, self._plan), setup)

    def _join_processes(self, bus: ZenohBus, conductor: Conductor) -> bool:
        """Wait until every process is there and the vehicle has introduced itself."""
        expected = conductor.strangers.expected
        deadline = time.monotonic() + START_TIMEOUT_S
        while not expected <= conductor.alive:
            if self._stop():
                return False
            self._look_after(conductor, time.monotonic())
            missing = ", ".join(sorted(expected - conductor.alive))
            if self._watch.given_up & expected:
                dead = ", ".join(sorted(self._watch.given_up & expected))
                raise DriveError(f"cannot be started: {dead}; see log.jsonl")
            if time.monotonic() > deadline:
                raise DriveError(f"not up after {START_TIMEOUT_S:.0f} s: {missing}; see log.jsonl")
            conductor.handle(conductor.mailbox.take(0.1))
        return self._ask_info(bus, conductor, deadline)

    def _ask_info(self, bus: ZenohBus, conductor: Conductor, deadline: float) -> bool:
        answers = Mailbox(4)
        while not self._stop():
            bus.request(
                "info", InfoRequest(), answers, timeout_s=2.0, vehicle=self._plan.config.vehicle_id
            )
            reply = answers.take(3.0)
            if isinstance(reply, Reply) and reply.message is not None:
                conductor.take_info(reply.message)
                return True
            if self._plan.config.resolved_source == "live":
                # A live car may start when it likes, and need not know our question.
                while (item := conductor.mailbox.take()) is not None:
                    conductor.handle(item)
                self._look_after(conductor, time.monotonic())
                first_ns = conductor.intake.first_stamp_ns
                # A gateway knows our question, and the antenna's place.
                if first_ns is not None and self._plan.ros2 is None:
                    conductor.take_info(unannounced(self._plan.config.vehicle_id, first_ns))
                    return True
            elif time.monotonic() > deadline:
                raise DriveError("the vehicle does not say what it is; see log.jsonl")
        return False

    def _look_after(self, conductor: Conductor, now_s: float) -> None:
        self._watch.look_after(conductor, now_s)
        if BUILDER in conductor.alive:
            conductor.worlds.ask_again(now_s)

    def _end(
        self,
        bus: ZenohBus,
        conductor: Conductor,
        line: ProgressLine,
        exit_word: str,
        started_s: float,
    ) -> bool:
        """End everything and say how it went; returns whether nothing of the run is lost."""
        plan = self._plan
        end = RunEnd(stamp_ns=conductor.intake.now_stamp_ns)
        bus.publish("run_end", end, run=plan.run_id)
        self._meter.write()  # what follows is no part of the drive
        to_write_s = LOCK_STEP_GRACE_S if plan.config.lock_step else END_GRACE_S
        quick = exit_word != "completed"
        grace_s = INTERRUPT_GRACE_S if quick else to_write_s
        if killed := self._supervisor.stop(grace_s=grace_s, but={ROUTER}):
            log.warning("had to kill %s", ", ".join(killed))
        try:
            while (item := conductor.mailbox.take_last(LAST_WORDS_S)) is not None:
                conductor.handle(item)
        except Exception:
            # An error of ours: what was found until here is written all the same.
            log.exception("the last messages could not be taken")
            exit_word = "failed"
            self._failed_at_end = True
        self._supervisor.stop(grace_s=0.0)  # the router: nobody has anything to say any more
        conductor.rounds.close()
        conductor.changes.refuse_all("the drive is over")
        conductor.beside.close()
        conductor.route.close()
        conductor.tables.close()
        now_s = time.monotonic()
        record = run_record(
            conductor,
            self._supervisor.restarted,
            exit_word=exit_word,
            wall_s=now_s - started_s,
            mono_s=now_s,
            troubles=self._watch.troubles,
        )
        write_record(record, plan.folder / RECORD)
        logging.shutdown()
        with contextlib.suppress(OSError):  # a full disk has been told of
            fold_stderr(plan.processes_dir, plan.folder / LOG)
        lost = lost_lines(record)
        line.say("\n".join([summary_text(record), *lost]))
        return not lost
