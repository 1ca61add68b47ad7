"""The driver `grpc`: a policy behind alpasim's service `egodriver.EgodriverService`, `--driver grpc:localhost:50051`.

The user starts the server; this tool is its client. A file that names a server as its driver connects to it only with
the user's consent, like any driver with a colon in its address.
"""

from __future__ import annotations

import contextlib
import re
import uuid
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NoReturn, Self

from foresee_dsl.drivers.deadlines import RESET_VARIABLE, STEP_VARIABLE, seconds_of
from foresee_dsl.drivers.protocol import Control, Mission, Observation, Trajectory, VehicleLimits
from foresee_dsl.errors import DriverError, DriverLateError, DriverUnavailableError

if TYPE_CHECKING:
    from foresee_bridges.grpc.messages import Messages

STEP_DEADLINE_S = 5.0
"""Limit of the wall time of an answer, s, unless FORESEE_STEP_DEADLINE_S is set. Ours: fifty times the 0.1 s of a plan,
since a large network may be slow on a busy machine."""
RESET_DEADLINE_S = 10.0
"""Limit of the wall time until the server has begun a session, s, unless FORESEE_RESET_DEADLINE_S is set. Ours: as for
programs."""
PLAN_S = 0.1
"""Simulated time between two plans, s: that of the package's own test loop."""
CLOSING_S = 1.0
"""Time that a server gets to end a session, s. Ours: as for programs."""
HOLD = Control(0.0, 0.0, 0.5)
"""Answer to an empty plan, with which a policy says that the ego shall stop. Ours: half of full braking."""
USAGE = "write grpc:HOST:PORT, such as grpc:localhost:50051, or grpc:unix:///PATH"
START = "start one, such as `carla-driver-interface serve --policy route_follower --port 50051`"
_ADDRESS = re.compile(r"unix(-abstract)?:.+|.+:\d{1,5}")


class PolicyServerDriver:
    """A policy behind alpasim's gRPC service: --driver grpc:localhost:50051."""

    name, version = "grpc", "1"

    def __init__(self, address: str) -> None:
        """Ask the server for its version.

        Raises:
            DriverError: the address is not one of a server, or no server answers there.
        """
        if not _ADDRESS.fullmatch(address):
            raise DriverError(f"grpc:{address} is not the address of a server; {USAGE}")
        self.name, self._address = f"grpc:{address}", address
        self.step_deadline_s = seconds_of(STEP_VARIABLE, STEP_DEADLINE_S)
        self._reset_s = seconds_of(RESET_VARIABLE, RESET_DEADLINE_S)
        self._channel: Any = None
        self._session = ""
        # The version is part of the keys of stored results, so that those of another policy are not taken for its own.
        # The channel is closed again, since a process with an open one cannot be forked.
        self._connect()
        version, _ = self._negotiate()
        self.version = version
        self.close()

    @classmethod
    def from_argument(cls, argument: str) -> Self:
        """Create the driver of the address `grpc:ARGUMENT`."""
        return cls(argument)

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Begin a session at the server."""
        from carla_driver_interface.contract import contract_metadata
        from carla_driver_interface.protocol import DriveSessionRequest

        from foresee_bridges.grpc.messages import Messages

        self.close()
        self._connect()
        self.version, revision = self._negotiate()
        session = str(uuid.uuid4())  # a server may have sessions of several runs at once
        request = DriveSessionRequest(session_uuid=session, random_seed=seed)
        request.debug_info.scene_id = "foresee-dsl"
        self._call(self._stub.start_session, request, self._reset_s, metadata=contract_metadata(revision))
        self._session = session
        self._messages: Messages = Messages(session, mission, vehicle)
        self._steps, self._every = 0, max(round(PLAN_S / mission.step_s), 1)
        self._plan: Trajectory | None = None

    def step(self, observation: Observation) -> Control | Trajectory:
        """Send the ego's motion; every `PLAN_S` also the route, and ask for a plan, which is followed until the
        next."""
        if not self._session:
            raise DriverError(f"{self.name} was stepped before reset, or after its session ended")
        self._call(self._stub.submit_egomotion_observation, self._messages.egomotion(observation), self.step_deadline_s)
        if self._steps % self._every == 0:
            self._ask(observation)
        self._steps += 1
        return HOLD if self._plan is None else self._plan

    def _ask(self, observation: Observation) -> None:
        """Get a new plan from the server."""
        self._call(self._stub.submit_route, self._messages.route(observation), self.step_deadline_s)
        request = self._messages.drive(observation, observation.time_s + PLAN_S)
        response = self._call(self._stub.drive, request, self.step_deadline_s)
        if response.terminate_session:
            raise DriverError(f"{self.name}: the policy ended the session at {observation.time_s:g} s")
        self._plan = self._messages.trajectory(response, observation.time_s)

    def close(self) -> None:
        """End the session and the connection."""
        channel, session = self._channel, self._session
        self._channel, self._session = None, ""
        if channel is None:
            return
        if session:
            from carla_driver_interface.protocol import DriveSessionCloseRequest

            with contextlib.suppress(Exception):  # the server may be gone
                self._stub.close_session(DriveSessionCloseRequest(session_uuid=session), timeout=CLOSING_S)
        channel.close()

    def _connect(self) -> None:
        """Open a channel to the server."""
        try:
            import grpc
            from carla_driver_interface import protocol
        except ModuleNotFoundError as err:
            raise DriverUnavailableError(
                f"{self.name} needs the package {err.name}: pip install 'foresee-bridges[grpc]'"
            ) from None
        self._channel = grpc.insecure_channel(self._address, options=protocol.channel_options())
        stub: Any = protocol.EgodriverServiceStub  # generated, without types
        self._stub = stub(self._channel)

    def _negotiate(self) -> tuple[str, int]:
        """Return the server's version and the revision of the contract that it speaks."""
        from carla_driver_interface.contract import ContractError, negotiate

        try:
            version, revision = negotiate(self._stub, timeout=self._reset_s)
        except ContractError as err:
            self._break(str(err))
        except Exception as err:
            self._fail(err, self._reset_s)
        return str(version.version_id), revision

    def _call(self, method: Callable[..., Any], request: Any, deadline_s: float, **options: Any) -> Any:  # noqa: ANN401
        """Call a method of the service; a failure ends the session."""
        try:
            return method(request, timeout=deadline_s, **options)
        except Exception as err:  # a `grpc.RpcError`, whose class is known only where grpc is installed
            self._fail(err, deadline_s)

    def _fail(self, err: Exception, deadline_s: float) -> NoReturn:
        """Raise a `DriverError` that says what happened to a call."""
        import grpc

        if not isinstance(err, grpc.RpcError):
            raise err
        code, details = err.code(), " ".join((err.details() or "").split())
        had_session = bool(self._session)
        self.close()
        if code is grpc.StatusCode.DEADLINE_EXCEEDED:
            raise DriverLateError(f"{self.name} did not answer within {deadline_s:g} s", deadline_s) from None
        if code is grpc.StatusCode.UNAVAILABLE:
            what = "the server ended" if had_session else f"no server answers; {START}"
            raise DriverError(f"{self.name}: {what} ({details})") from None
        raise DriverError(f"{self.name}: the server answered {code.name}: {details}") from None

    def _break(self, text: str) -> NoReturn:
        self.close()
        raise DriverError(f"{self.name}: {text}") from None
