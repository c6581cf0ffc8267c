"""Port URLs: the options of a simulated board in ``sim://BOARD?key=value&...``, read and completed in one place."""

from __future__ import annotations

from urllib.parse import parse_qsl, urlencode, urlsplit, urlunsplit

from haptics.errors import InputError

_SIMULATED = "sim://"
_LEGIBLE = ",=:/"
"""Characters that need no escape within a value, so that ``faults=drop=0.01`` stays as it is typed."""


def is_simulated(url: str) -> bool:
    """Whether a port URL names a simulated board or instrument.

    :param url: a port as a user gives it.
    :return: True for ``sim://...``.
    """
    return url.startswith(_SIMULATED)


def query_of(url: str) -> dict[str, str]:
    """The keys and values of a ``sim://`` URL.

    :param url: a port as a user gives it.
    :return: values as text by key; empty for any other port.
    :raises InputError: a key given twice.
    """
    query: dict[str, str] = {}
    for key, value in parse_qsl(urlsplit(url).query, keep_blank_values=True) if is_simulated(url) else ():
        if key in query:
            raise InputError(f"{key} is given twice in {url!r}")
        query[key] = value
    return query


def with_defaults(url: str, **defaults: object) -> str:
    """A ``sim://`` URL completed with those keys that it does not name; any other URL unchanged.

    :param url: a port as a user gives it.
    :param defaults: keys and values to add where they are missing.
    :return: the URL.
    :raises InputError: a key given twice.
    """
    if not is_simulated(url):
        return url
    query = {**query_of(url), **{key: str(value) for key, value in defaults.items() if key not in query_of(url)}}
    return urlunsplit(urlsplit(url)._replace(query=urlencode(query, safe=_LEGIBLE)))
