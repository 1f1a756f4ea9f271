"""`/protocol.json`: the messages of the game socket as a JSON Schema, for clients in any language."""

from fastapi import APIRouter, Response

from server.play.protocol_schema import protocol_json

router = APIRouter()


@router.get("/protocol.json")
async def protocol() -> Response:
    """Return the schema; it is the same for everybody and needs no cookie."""
    return Response(protocol_json(), media_type="application/json")
