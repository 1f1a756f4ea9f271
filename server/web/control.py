"""Give routes what carries out commands on games, whichever process plays them."""

from typing import Annotated

from fastapi import Depends

from server.cluster.command_dispatch import ClusterControl
from server.web.services import ServicesDep


def control_of(services: ServicesDep) -> ClusterControl:
    return services.control


ControlDep = Annotated[ClusterControl, Depends(control_of)]
