"""Prints an MCAP recording as Python's own libraries read it, one value a line, separated by tabs.

    metadata  KEY  VALUE
    TOPIC  SEQUENCE  LOG_TIME_NS  PUBLISH_TIME_NS  FIELD  VALUE

Usage: read_with_mcap.py FILE. Needs the packages mcap and mcap-protobuf-support.
"""

import sys

from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

sys.stdout.reconfigure(encoding="utf-8")
with open(sys.argv[1], "rb") as file:
    reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
    for record in reader.iter_metadata():
        for key, value in record.metadata.items():
            print("metadata", key, value, sep="\t")
    for _schema, channel, message, decoded in reader.iter_decoded_messages():
        for field in decoded.DESCRIPTOR.fields:
            if not field.has_presence or decoded.HasField(field.name):
                value = getattr(decoded, field.name)
                print(channel.topic, message.sequence, message.log_time, message.publish_time, field.name, value, sep="\t")
