"""The orchestrator of one drive: joins its processes, runs the loop over it, and ends it."""

from __future__ import annotations

import contextlib
import logging
import time

from foretwin.contracts.bus import ZenohBus
from foretwin.contracts.cpu_use import CpuMeter
from foretwin.contracts.errors import UserError
from foretwin.contracts.keys import alive_key
from foretwin.contracts.one_heap import FreeMemory
from foretwin.contracts.signing import OrderSigner
from foretwin.contracts.simulation import RunEnd
from foretwin.orchestrator.drive.conductor import Conductor
from foretwin.orchestrator.drive.exit_words import EXIT_FAILED, IN_ORDER, VEHICLE_ENDED, exit_code
from foretwin.orchestrator.drive.handing_over import HandingOver
from foretwin.orchestrator.drive.in_charge import InCharge
from foretwin.orchestrator.drive.interrupt import Interruption
from foretwin.orchestrator.drive.joining import Joining
from foretwin.orchestrator.drive.live_loop import LiveLoop
from foretwin.orchestrator.drive.lock_step import LockStepError, LockStepLoop
from foretwin.orchestrator.drive.metrics_server import told_metrics
from foretwin.orchestrator.drive.mission import Mission, MissionSettings
from foretwin.orchestrator.drive.operator_metrics import DriveCounts
from foretwin.orchestrator.drive.process_watch import ProcessWatch
from foretwin.orchestrator.drive.processes import BUILDER, ORCHESTRATOR, ROUTER, member
from foretwin.orchestrator.drive.progress import ProgressLine, waiting_text
from foretwin.orchestrator.drive.record_keeper import RecordKeeper
from foretwin.orchestrator.drive.router_start import join_bus
from foretwin.orchestrator.drive.run_record import lost_lines, reserve_record
from foretwin.orchestrator.drive.standing import go_on, read_standing
from foretwin.orchestrator.drive.start_worlds import prepare_start
from foretwin.orchestrator.drive.summary import summed_up
from foretwin.orchestrator.drive.supervision import CRASH, DriveError, DriveProcesses, Life
from foretwin.orchestrator.drive.watcher_setups import COPILOT, RECORDER, addresses
from foretwin.orchestrator.instructions import Notice
from foretwin.orchestrator.plan import DrivePlan
from foretwin.orchestrator.record.results import ResultTables
from foretwin.orchestrator.record.run_state import LOG, RECORD, RESULTS
from foretwin.orchestrator.runner.supervisor import fold_stderr

log = logging.getLogger(ORCHESTRATOR)

END_GRACE_S, LOCK_STEP_GRACE_S = 10.0, 120.0
"""What recorder and viewer get to write at the end of a drive, live and where nothing may miss."""
LAST_WORDS_S = 0.1
"""How long nothing may come from processes that have ended before all is taken for heard."""
INTERRUPT_GRACE_S = 1.2


class CrashError(RuntimeError):
    """An error of ours has ended an orchestrator; the next one goes on with the drive."""


class Orchestrator:
    """One drive, or what is left of it since another orchestrator died."""

    def __init__(
        self,
        plan: DrivePlan,
        processes: DriveProcesses,
        life: Life,
        *,
        signer: OrderSigner | None = None,
    ) -> None:
        self._plan, self._processes, self._life, self._signer = plan, processes, life, signer
        self._interruption = Interruption()
        self._watch = ProcessWatch(processes)
        self._meter = CpuMeter(plan.processes_dir, ORCHESTRATOR)
        self._failed_at_end = self._refused = self._over = False
        self._before = read_standing(life.standing)
        self._standing: HandingOver
        self._loop: LiveLoop | None = None
        self._mission = Mission(
            plan.way_ahead(),
            MissionSettings(
                radius_m=plan.config.radius_m,
                look_ahead_s=plan.config.look_ahead_s,
                horizon_s=plan.config.horizon_s,
                begins_s=plan.config.start_s,
            ),
        )

    def run(self) -> int:
        """Run to the end, whatever ends it; the run's files are complete afterwards.

        Returns the exit code. Raises CrashError where the drive goes on without this one, and what
        ended the drive where that is an error.
        """
        try:
            return self._run()
        except Exception as error:
            if self._over or not self._may_be_followed(error):
                raise
            raise CrashError(str(error)) from error

    def _run(self) -> int:
        plan = self._plan
        with join_bus(plan) as bus:
            tables = ResultTables(
                plan.folder / RESULTS, plan.origin, lossless=plan.config.lock_step, keep=plan.keep
            )
            conductor = Conductor(plan, bus, self._mission, tables)
            self._standing = HandingOver(conductor, self._watch, keep=self._processes.keep)
            exit_word = "failed"
            with ProgressLine(conductor, self._mission) as line:
                conductor.events.on_event = line.tell
                try:
                    exit_word = self._go(bus, conductor, line)
                except Exception as error:
                    log.exception("the orchestrator ended by an error")
                    self._refused = isinstance(error, UserError)  # its one line says all
                    if self._may_be_followed(error):
                        self._leave_to_next(conductor)
                    else:
                        self._end(bus, conductor, line, exit_word)
                    raise
                whole = self._end(bus, conductor, line, exit_word)
        return EXIT_FAILED if self._failed_at_end else exit_code(exit_word, whole=whole)

    def _may_be_followed(self, error: Exception) -> bool:
        """Whether another one may do better, also than one that follows another and had no memory
        to begin with; what is true for each ends the drive."""
        told = isinstance(error, (DriveError, LockStepError))
        begun = self._loop is not None or self._before is not None
        return begun and not (told or self._life.last) and self._processes.start_again

    def _leave_to_next(self, conductor: Conductor) -> None:
        if self._loop is not None:  # else it may not yet stand where the one before it did
            self._standing.all()
        conductor.route.close()
        conductor.beside.close()
        conductor.tables.leave()

    def _go(self, bus: ZenohBus, conductor: Conductor, line: ProgressLine) -> str:
        """Run the drive; returns how it ended, in a word."""
        plan, before = self._plan, self._before
        conductor.join()
        if before is not None:
            crashed = self._life.ended_by[-1] == CRASH
            go_on(conductor, self._watch, before, plan.folder / RESULTS, crashed=crashed)
            self._tell_of_restart(conductor)
            if before.exit_word or self._life.last:
                return before.exit_word or "failed"
        else:
            # A run that is listed can be spoken to: questions wait in the mailbox from here on.
            reserve_record(plan, plan.folder / RECORD)
            line.say(f"run {plan.folder}")
            for address in addresses(plan, plan.bus_of(member(plan, COPILOT))):
                line.say(address)
            line.say(plan.config.tuning_choice.text)
            if plan.config.resolved_source == "live":
                line.say(waiting_text(plan))
            joining = Joining(bus, conductor, self._watch, self._look_after, self._stop)
            if not joining.all_there():
                return self._stopped_by()
            prepare_start(plan, conductor, look_after=self._look_after, stop=self._stop)
        bus.declare_alive(alive_key(run=plan.run_id, process=ORCHESTRATOR))
        self._meter.ready()

        keeper, counts = self._keeper(conductor), DriveCounts(conductor)
        told = told_metrics(plan.metrics, counts.samples, processes=plan.processes_dir)

        free_memory = FreeMemory(time.monotonic())

        def housekeeping(now_s: float) -> None:
            self._look_after(conductor, now_s)
            self._processes.let_give_way(conductor.alive, now_s)
            conductor.rounds.dispatcher.give_out()
            conductor.fleet.look(now_s)
            conductor.beside.look(now_s)
            self._keep_junctions(conductor, now_s)
            self._meter.look()
            free_memory.look(now_s)
            keeper.look(now_s)
            line.update(now_s)
            counts.look(now_s)
            tell_metrics(now_s)

        loop: LockStepLoop | LiveLoop
        if plan.config.lock_step:
            loop = LockStepLoop(conductor, housekeeping=housekeeping, stop=self._stop)
        else:
            # What has stopped towards a vehicle must not resume by itself.
            towards = plan.towards_vehicle and before is None
            say_in_charge = InCharge(bus, plan, self._signer).say if towards else lambda: None

            def each_turn() -> None:
                say_in_charge()
                self._standing.news()

            loop = self._loop = self._standing.loop = LiveLoop(
                conductor,
                housekeeping=housekeeping,
                stop=self._stop,
                each_turn=each_turn,
                before=None if before is None else before.grid,
            )
        ended = False
        try:
            with told as tell_metrics:
                ended = loop.run()
        except LockStepError:
            # Who does not answer may have died: that is told next.
            if not self._watch.comes_to_an_end(conductor):
                raise
        word = "completed" if ended else self._stopped_by()
        if self._in_order(word):
            self._watch.wait_for(RECORDER, conductor, stop=self._stop)
            conductor.finish()
        return word

    def _in_order(self, word: str) -> bool:
        """Whether a drive ends as such drives do; a live car's has no end but being told."""
        return word in IN_ORDER or (
            word == "interrupted" and self._plan.config.resolved_source == "live"
        )

    def _stopped_by(self) -> str:
        """Return how a drive ended that was stopped; raises DriveError for an error of ours."""
        if self._asked_to_end:
            return "interrupted"
        if self._watch.ended_by is not None:
            raise DriveError(f"{self._watch.ended_by}; see log.jsonl")
        return VEHICLE_ENDED

    @property
    def _asked_to_end(self) -> bool:
        return self._interruption.asked or self._processes.over

    def _stop(self) -> bool:
        return self._asked_to_end or self._watch.over

    def _tell_of_restart(self, conductor: Conductor) -> None:
        how = self._life.ended_by[-1]
        conductor.tell(Notice("warning", f"the orchestrator ended by {how}; this is another one"))
        if self._plan.towards_vehicle:
            stays = "nothing goes towards the vehicle any more: that does not resume by itself"
            conductor.tell(Notice("warning", stays))

    def _keeper(self, conductor: Conductor) -> RecordKeeper:
        return RecordKeeper(conductor, self._processes, self._watch, self._life)

    def _keep_junctions(self, conductor: Conductor, now_s: float) -> None:
        news = self._mission.visits.take_news()
        conductor.tables.add("junctions", [visit.row(mono_s=now_s) for visit in news])

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
    ) -> bool:
        """End everything and say how it went; returns whether nothing of the run is lost."""
        plan, self._over = self._plan, True
        self._standing.all(exit_word=exit_word)
        self._meter.write()  # what follows is no part of the drive
        end = RunEnd(stamp_ns=conductor.intake.now_stamp_ns)
        bus.publish("run_end", end, run=plan.run_id)
        to_write_s = LOCK_STEP_GRACE_S if plan.config.lock_step else END_GRACE_S
        grace_s = to_write_s if self._in_order(exit_word) else INTERRUPT_GRACE_S
        if killed := self._processes.stop(grace_s=grace_s, but={ROUTER}):
            log.warning("had to kill %s", ", ".join(killed))
        try:
            while (item := conductor.mailbox.take_last(LAST_WORDS_S)) is not None:
                conductor.handle(item)
            if self._in_order(exit_word):
                conductor.rounds.judge()
        except Exception:
            # An error of ours: what was found until here is written all the same.
            log.exception("what came last could not be taken")
            exit_word = "failed"
            self._failed_at_end = True
        self._processes.stop(grace_s=0.0)  # the router: nobody has anything to say any more
        conductor.refusals.look_now()
        conductor.rounds.close()
        conductor.changes.refuse_all("the drive is over")
        conductor.beside.close()
        conductor.route.close()
        now_s = time.monotonic()
        self._keep_junctions(conductor, now_s)
        conductor.tables.close()
        record = self._keeper(conductor).write(exit_word)
        lost, summary = lost_lines(record), summed_up(record)
        self._failed_at_end |= summary.failed
        logging.shutdown()
        with contextlib.suppress(OSError):  # a full disk has been told of
            fold_stderr(plan.processes_dir, plan.folder / LOG)
        if not self._refused:
            line.say("\n".join([summary.text, *lost]))
        return not lost
