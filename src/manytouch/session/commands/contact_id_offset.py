"""Unique contact ids when the estimation starts again."""

from dataclasses import replace

from manytouch.values import Contact, Contacts, Phase, Reading


class ContactIdOffset:
    """Offsets the ids after each start past all ids before it, and ends the contacts before it."""

    def __init__(self) -> None:
        self._first_id = 0
        self._next_id = 0
        self._touching: tuple[Contact, ...] = ()
        self._to_end: tuple[Contact, ...] = ()

    def begin(self) -> None:
        """The next reading is the first after a start of the estimation."""
        self._first_id = self._next_id
        self._to_end = self._to_end or self._touching
        self._touching = ()

    def __call__(self, reading: Reading) -> Reading:
        """The reading with ids that no other contact of the session has had."""
        named = [replace(contact, id=contact.id + self._first_id) for contact in reading.contacts.contacts]
        ended = [replace(contact, phase=Phase.END) for contact in self._to_end]
        self._to_end = ()
        self._next_id = max([self._next_id, *(contact.id + 1 for contact in named)])
        contacts = Contacts(contacts=(*ended, *named), status=reading.contacts.status)
        self._touching = contacts.touching
        return replace(reading, contacts=contacts)
