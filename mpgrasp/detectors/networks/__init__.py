"""The networks: image in; quality, cosine, sine and width out."""
