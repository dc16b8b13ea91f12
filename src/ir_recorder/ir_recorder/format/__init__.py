"""What a recording file holds beside its messages: schemas, quality of service, attachments."""
