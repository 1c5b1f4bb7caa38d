# mpgrasp with headless OpenGL and the pinned versions.
#
#   docker build -t mpgrasp .
#   docker run --rm -v "$PWD:/data" mpgrasp bench thin --detector dhrnet --episodes 20 --out run
#
# For training, recordings, meshes or policies: --build-arg EXTRAS=torch,rerun,objects,sb3
FROM python:3.11-slim

RUN apt-get update \
    && apt-get install -y --no-install-recommends libegl1 libgl1-mesa-dri \
    && rm -rf /var/lib/apt/lists/*

ARG EXTRAS=rerun
COPY . /src
RUN pip install --no-cache-dir "/src[${EXTRAS}]" -c /src/constraints.txt

# Results, and networks as they were compiled for this processor, stay with whoever runs it.
WORKDIR /data
ENV MPGRASP_CACHE=/data/.mpgrasp-cache
ENTRYPOINT ["mpgrasp"]
CMD ["bench", "--help"]
